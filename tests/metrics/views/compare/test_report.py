"""Comparisons as text, Markdown, JSON and a page."""

import json
from dataclasses import fields, replace

import numpy as np
import pytest
from made_scores import iqtt_scores, rooms_scores
from pages import Page
from refusals import refused

from metrics.prediction_writer import RoomPredictionWriter
from metrics.scoring.evaluate import score
from metrics.views.compare.compare import Comparison, Difference, compare
from metrics.views.compare.report import AtHandError, html_report, text_report, to_json
from scenegen.common.errors import FileFormatError
from scenegen.rooms.reader import RoomsFile

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
    assert "NOT COMPARABLE" in text.splitlines()[0]
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
    assert row[1].split()[0] == "+0.03000"
    assert row[-1] == "worse"
    questions = [iqtt_scores("a", [1, 0, 1]), iqtt_scores("b", [1, 1, 1])]
    page = Page(html_report(compare(questions), questions))
    assert any(row[0] == "mirror" and row[1].startswith("0.6667") for row in page.rows)


def test_pictures_need_the_files_that_were_scored(rooms_path, tmp_path):
    paths = [tmp_path / "a.h5", tmp_path / "b.h5"]
    with RoomsFile(rooms_path) as truth:
        for i, path in enumerate(paths):
            with RoomPredictionWriter(path, rooms_path, method="m") as out:
                for row in range(len(truth)):
                    depth = np.nan_to_num(truth.read("depth", row), nan=1.0)
                    out.add(row, depth + 0.01 * (row + i))
    files = [score([path], rooms_path) for path in paths]
    compared = compare(files)
    moved = [path.rename(tmp_path / f"moved-{path.name}") for path in paths]
    assert Page(html_report(compared, files, rooms_path)).pictures == []
    assert len(Page(html_report(compared, files, rooms_path, moved)).pictures) == 6 * 6
    last = [replace(f, columns={**f.columns, "row": f.columns["row"] + 1}) for f in files]
    with pytest.raises(FileFormatError) as missing:
        html_report(compared, last, rooms_path, moved)
    assert missing.value.found.startswith("items.row")
    for truth, submissions in ((moved[0], moved), (rooms_path, [rooms_path])):
        with refused(AtHandError, str(truth if truth == moved[0] else rooms_path)):
            html_report(compared, files, truth, submissions)
