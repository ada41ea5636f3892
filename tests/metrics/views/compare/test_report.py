"""Comparisons as text, Markdown, JSON and a page."""

import json
from dataclasses import fields

import numpy as np
import pytest
from made_scores import iqtt_scores, rooms_scores
from pages import Page

from metrics.views.compare.compare import Comparison, Difference, compare
from metrics.views.compare.report import html_report, text_report, to_json

HOSTILE = "a|b_*</title><script>&\x1b[31m\n\u202e近"
SHOWN = r"a|b_*</title><script>&\x1b[31m \u202e近"


def three_methods():
    base = np.random.default_rng(0).gamma(2.0, 0.1, 20)
    columns = {"first": base, HOSTILE: base + 0.03, "same": base * 1.0}
    labels = np.repeat(np.arange(10), 2)
    return [
        rooms_scores(name, {"chamfer": c, "mse_depth": c**2}, labels) for name, c in columns.items()
    ]


@pytest.fixture(scope="module")
def comparison():
    return compare(three_methods(), ["chamfer", "mse_depth"])


def test_the_table_has_every_number_in_aligned_lines(comparison):
    lines = text_report(comparison, three_methods()).splitlines()
    assert all(line.isprintable() for line in lines)
    worse, _ = (line for line in lines if "0/10/0" in line)
    assert "+0.03000 [+0.03000, +0.03000]" in worse
    assert SHOWN in worse
    assert worse.endswith("worse")
    same = next(line for line in lines if line.startswith("  same"))
    assert " ".join(same.split()[2:]) == "0 [0, 0] 0/0/10 1.0000 1.0000 none not shown"


def test_json_holds_every_attribute_and_no_nan(comparison):
    content = json.loads(to_json(comparison), parse_constant=pytest.fail)
    assert content["format"] == "pix2shape-bench/comparison"
    assert {field.name for field in fields(Comparison)} < set(content)
    assert (content["family"], content["alpha"], content["confidence"]) == (4, 0.05, 0.95)
    for difference, stored in zip(comparison.differences, content["differences"], strict=True):
        for field in fields(Difference):
            assert stored[field.name] == getattr(difference, field.name)
        assert stored["verdict"] == difference.verdict
    single = compare(
        [rooms_scores(n, {"chamfer": [0.1 * i]}, [0]) for i, n in enumerate("abc", 1)], ["chamfer"]
    )
    stored = json.loads(to_json(single), parse_constant=pytest.fail)["differences"][0]
    assert (stored["low"], stored["high"], stored["smallest"]) == (None, None, None)


def test_what_is_not_comparable_is_stamped():
    files = [iqtt_scores("a", [1, 0] * 10), iqtt_scores("b", [1, 1] * 10, comparable=False)]
    text = text_report(compare(files, allow_incomparable=True), files)
    assert text.splitlines()[1].startswith("WARNING  not comparable")
    assert "10/0/10" in text


def test_the_page_answers_first_and_names_stay_texts(comparison):
    page = Page(html_report(comparison, three_methods()))
    assert f"{SHOWN[:8]}" in page.text
    assert "script" not in page.tags
    assert page.text.index("worse in Chamfer, MSE-depth") < page.text.index("Differences")
    assert page.text.index("no difference shown in Chamfer, MSE-depth") < page.text.index(
        "p (Holm)"
    )
    row = next(row for row in page.rows if row[0].startswith("a|b") and len(row) == 8)
    assert row[2].split()[0] == "+0.03000"
    assert row[-1] == "worse"
    questions = [iqtt_scores("a", [1, 0, 1]), iqtt_scores("b", [1, 1, 1])]
    page = Page(html_report(compare(questions), questions))
    assert any(row[0] == "accuracy, mirror" and row[1].startswith("0.6667") for row in page.rows)
