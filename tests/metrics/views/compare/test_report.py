"""Comparisons as text, Markdown and JSON."""

import json
from dataclasses import fields

import numpy as np
import pytest
from made_scores import iqtt_scores, rooms_scores

from metrics.views.compare.compare import Comparison, Difference, compare
from metrics.views.compare.report import text_report, to_json

HOSTILE = "a|b_*<script>&\x1b[31m\n\u202e近"


@pytest.fixture(scope="module")
def comparison():
    labels = np.repeat(np.arange(10), 2)
    base = np.random.default_rng(0).gamma(2.0, 0.1, 20)
    columns = {"first": base, HOSTILE: base + 0.03, "same": base * 1.0}
    files = [
        rooms_scores(name, {"chamfer": c, "mse_depth": c**2}, labels) for name, c in columns.items()
    ]
    return compare(files, ["chamfer", "mse_depth"])


def test_the_table_says_everything_in_aligned_lines(comparison):
    lines = text_report(comparison).splitlines()
    assert lines[0] == "Against first, over 20 images of 10 scenes (truth fedcba987654)."
    assert lines[2] == "chamfer (scene unit, lower is better)"
    assert "mse_depth (scene unit squared, lower is better)" in lines
    shown = [line for line in lines if "0/10/0" in line]
    assert len(shown) == 2
    assert "+0.03000 [+0.03000, +0.03000]" in shown[0]
    assert shown[0].endswith("worse")
    assert r"a|b_*<script>&\x1b[31m \u202e近" in shown[0]
    same = next(line for line in lines if line.startswith("  same"))
    assert " ".join(same.split()[2:]) == "0 [0, 0] 0/0/10 1.0000 1.0000 none not shown"
    assert all(line.isprintable() for line in lines)
    assert any("corrected for 4 comparisons" in line for line in lines)


def test_markdown_escapes_names_and_keeps_its_columns(comparison):
    text = text_report(comparison, as_markdown=True)
    rows = [line for line in text.splitlines() if line.startswith("| ")]
    assert len(rows) == 2 * 5
    for row in rows:
        assert row.replace(r"\|", "").count("|") == 9
    assert r"a\|b\_\*&lt;script&gt;&amp;" in text
    assert "<script>" not in text
    assert "\u202e" not in text


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
    assert "[" not in text_report(single).split("chamfer (", 1)[1].split("difference:")[0]


def test_questions_and_what_is_not_comparable_say_so():
    files = [iqtt_scores("a", [1, 0] * 10), iqtt_scores("b", [1, 1] * 10, comparable=False)]
    text = text_report(compare(files, allow_incomparable=True))
    assert text.startswith("Against a, over 20 questions (truth fedcba987654). NOT COMPARABLE")
    assert "iqtt_accuracy (fraction, higher is better)" in text
    assert "10/0/10" in text
    assert "p: exact McNemar test, two-sided" in text
    assert "\nnote: b says that it is not comparable" in text
    several = [*files[:1], iqtt_scores("c", [1, 1 / 3] * 10, runs=3), iqtt_scores("d", [1] * 20)]
    assert "p: exact McNemar test; sign flips for means" in text_report(compare(several))
