"""Scores as aligned text, Markdown and CSV."""

import csv
import re
from types import MappingProxyType

import pytest
from made_scores import iqtt_scores, simple_rooms, stated

from metrics.views.report import html_report
from metrics.views.report import text_report, write_csv
from metrics.score_file import Skill
from metrics.scoring.floors import Floor
from scenegen.common.text_table import number


def rooms(name="mine", numbers=MappingProxyType({}), **other):
    scores = simple_rooms(name, **other)
    return stated(scores, by_view_angle=dict.fromkeys(("0", "35", "5"), scores.metrics), **numbers)


def test_the_text_shows_every_score_and_its_reference():
    scores = rooms(noise_floors={"chamfer": 0.0123}, truth_given=False)
    title, _, table, *_, notes = text_report(scores).split("\n\n")
    assert title == "mine: 4 images of 2 scenes of rooms.h5"
    cells = {line.split()[0]: line.split() for line in table.splitlines()}
    assert cells["score"][1:4] == ["value", "95%", "interval"]
    for name, score in scores.metrics.items():
        assert cells[name][1:3] == [number(score.value), f"[{number(score.low, score.value)},"]
    assert cells["noise"][:3] == ["noise", "floor", "0.0123"]
    assert f"warning: {scores.warnings[0]}" in notes.splitlines()
    (told,) = (line for line in notes.splitlines() if line.startswith("truth: "))
    assert all(word in told for word in ("rooms.h5", scores.meta.truth_digest[:12], "submission"))
    questions = iqtt_scores("many", [1, 0], runs=3)
    text = text_report(questions)
    assert text.startswith("many: 2 questions of rooms.h5, mean of 3 runs\n")
    assert "chance 0.3333" in " ".join(text.split())


def lines_of(text):
    """The cells of each line, by the first one."""
    lines = (re.split(r"\s{2,}", line.strip()) for line in text.splitlines())
    return {cells[0]: cells[1:] for cells in lines}


def test_the_headline_comes_first_with_skills_and_their_floors(monkeypatch):
    skills = {"chamfer": Skill(-0.25, -0.5, 0.1, 0.16, "empty_room_chamfer")}
    text = text_report(rooms(numbers={"skills": skills}, noise_floors={"chamfer": 0.0123}))
    head, rest = text.split("all scores")
    assert lines_of(head)["skill of chamfer"] == ["-0.2500", "[-0.5000, 0.1000]", "0: empty room"]
    assert lines_of(head)["chamfer"][-1] == "0.1600: empty room; noise floor 0.0123"
    assert lines_of(rest.split("by degrees")[0])["chamfer"][3] == "0.1600"
    assert any("1 is perfect" in line for line in rest.splitlines())
    floors = (Floor("mirror", "outline", 0, 0.5, 0.4, 0.6),)
    monkeypatch.setattr("metrics.scoring.floors.FLOORS", floors)
    accuracy = Skill(0.0, None, None, 0.5, "outline")
    text = text_report(iqtt_scores("a", [1, 0], skills={"iqtt_accuracy": accuracy}))
    head, rest = text.split("all scores")
    assert lines_of(head)["skill of iqtt_accuracy"][-1] == "0: outline"
    assert lines_of(head)["iqtt_accuracy"][-1] == "0.5000: outline; chance 0.3333"
    assert lines_of(rest)["chance"][0] == "0.3333"
    assert lines_of(rest)["mirror"] == ["0.5000 -", "2", "0.0000 -", "0.5000: outline"]


@pytest.mark.parametrize("form", ["text", "markdown", "html"])
def test_groups_stand_in_the_order_of_their_numbers(form, tmp_path):
    scores = iqtt_scores("a", [1, 0])
    (group,) = scores.by_distractor.values()
    spans = ["120-150", "150-180", "30-60", "60-90", "90-120"]
    scores = stated(scores, by_rotation_angle=dict.fromkeys(spans, group))
    if form == "html":
        text = html_report(scores, tmp_path, [])
    else:
        text = text_report(scores, form == "markdown")
    shown = re.findall(r"\b(?:\d+)-(?:\d+)\b", text)
    assert shown == ["30-60", "60-90", "90-120", "120-150", "150-180"]


def test_markdown_escapes_the_methods_name():
    text = text_report(rooms("a|b_*c*<x>\nnew"), as_markdown=True)
    assert text.startswith(r"a\|b\_\*c\*&lt;x&gt; new: 4 images")
    for block in text.split("\n\n"):
        rows = [line for line in block.splitlines() if line.startswith("|")]
        assert len({len(re.findall(r"(?<!\\)\|", row)) for row in rows}) <= 1


def test_csv_holds_every_item_to_the_last_digit(tmp_path):
    scores = simple_rooms()
    write_csv(scores, tmp_path / "x.csv")
    with (tmp_path / "x.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    for name, column in scores.items.items():
        assert [float(row[name]) for row in rows] == column.tolist()
    with pytest.raises(FileExistsError):
        write_csv(scores, tmp_path / "x.csv")
