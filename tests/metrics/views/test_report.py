"""Scores of one submission as text, Markdown, CSV and a page."""

import csv
import re
from dataclasses import replace

import numpy as np
import pytest
from made_scores import iqtt_scores, make_score, rooms_scores, simple_rooms, stated
from pages import Page, cells_of
from refusals import refused

from iqtt.floors import Floor
from metrics.measures.relief import empty_room
from metrics.prediction_writer import RoomPredictionWriter, write_answers
from metrics.score_file import Skill
from metrics.scoring.evaluate import open_runs, score
from metrics.scoring.records import Submission
from metrics.scoring.truth_digests import OtherTruthError
from metrics.views.headline import headline_section, kinds_sections
from metrics.views.report import html_report
from metrics.views.score_tables import (
    all_scores,
    group_tables,
    headline_rows,
    notes_of,
    text_report,
    title_of,
    write_csv,
)
from scenegen.common.text_table import with_interval
from scenegen.rooms.reader import RoomsFile

CONTROLS = "\x1b[2J\x9b\u202e\u2066\x07"
HOSTILE = "</title></style><script>alert(1)</script>\"'><img src=http://x.y>&"
SKILLS = {"chamfer": Skill(-0.25, -0.5, -0.1, 0.16, "empty_room_chamfer")}


def test_every_score_stands_beside_its_reference():
    scores = simple_rooms(skills=SKILLS)
    table = all_scores(scores)
    cells = cells_of(table)
    for name, value in scores.metrics.items():
        assert cells[name][:2] == [*with_interval(value.value, value.low, value.high)]
    assert cells["chamfer"][3] == "0.1600"
    head = cells_of(headline_rows(scores))
    assert head["skill of chamfer"] == ["-0.2", "[-0.5, -0.1]", "0: empty room"]
    assert head["chamfer"][-1] == "0.1600: empty room"


def test_questions_have_the_floor_of_their_kind():
    floors = (Floor("mirror", "outline", 0.5, 2500),)
    accuracy = {"iqtt_accuracy": Skill(0.0, None, None, 0.5, "outline")}
    group = {"mirror": {"iqtt_accuracy": make_score("iqtt_accuracy", 1 / 3)}}
    by_kind, by_answer = {"skills": accuracy, "by_distractor": group}, {"2": group["mirror"]}
    scores = iqtt_scores("a", [1, 0], **by_kind, by_position=by_answer, question_floors=floors)
    head = cells_of(headline_rows(scores))
    assert head["skill of iqtt_accuracy"][-1] == "0: outline"
    assert head["iqtt_accuracy"][-1] == "0.5: outline; chance 0.3"
    assert cells_of(all_scores(scores))["  chance"][0] == "0.3"
    kinds, places = group_tables(scores)
    assert list(cells_of(places)) == ["C"]
    assert len(text_report(scores).splitlines()) < len(text_report(scores, whole=True).splitlines())
    assert cells_of(kinds) == {"mirror": ["0.3333", "2", "-0.3333", "0.5000: outline"]}


def test_titles_and_notes_say_where_scores_come_from():
    scores = simple_rooms(truth_given=False)
    assert title_of(scores) == "mine: 4 images of 2 scenes of rooms.h5"
    notes = list(notes_of(scores))
    assert notes[0] == f"warning: {scores.warnings[0]}"
    (truth,) = (note for note in notes if note.startswith("truth: "))
    assert scores.meta.truth_digest[:12] in truth
    assert title_of(iqtt_scores("many", [1, 0], runs=3)).endswith("of rooms.h5, mean of 3 runs")


@pytest.mark.parametrize("form", ["text", "markdown", "html"])
def test_groups_stand_in_the_order_of_their_numbers(form, tmp_path):
    spans = ["120-150", "150-180", "30-60", "60-90", "90-120"]
    group = {"iqtt_accuracy": make_score("iqtt_accuracy", 0.5)}
    scores = iqtt_scores("a", [1, 0], by_rotation_angle=dict.fromkeys(spans, group))
    if form == "html":
        text = re.sub('data:[^"]*', "", html_report(scores))
    else:
        text = text_report(scores, form == "markdown", whole=True)
    shown = re.findall(r"\b(?:\d+)-(?:\d+)\b", text)
    assert shown == ["30-60", "60-90", "90-120", "120-150", "150-180"]


def test_csv_holds_every_item_to_the_last_digit(tmp_path):
    scores = simple_rooms()
    write_csv(scores, tmp_path / "x.csv")
    with (tmp_path / "x.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    for name, column in scores.items.items():
        assert [float(row[name]) for row in rows] == column.tolist()
    with pytest.raises(FileExistsError):
        write_csv(scores, tmp_path / "x.csv")


def test_the_page_is_whole_escapes_names_and_loads_nothing(rooms_path, tmp_path):
    path = tmp_path / "flat.h5"
    with RoomsFile(rooms_path) as rooms, RoomPredictionWriter(path, rooms_path, method="m") as out:
        for row in range(len(rooms)):  # the later a room, the more its objects stand out
            room = rooms[row]
            camera = room.world_from_camera, room.fov_y_degrees
            empty, _ = empty_room(*camera, *room.depth.shape)
            out.add(row, empty + (row + 1) / len(rooms) * (room.depth - empty))
    scores = score([path], rooms_path)
    runs = (Submission(HOSTILE, "0" * 64, HOSTILE),)
    meta = replace(scores.meta, truth_path=HOSTILE, submissions=runs)
    hostile = replace(scores, method=HOSTILE, meta=replace(meta, truth_given=False))
    controls = replace(scores, method=CONTROLS, meta=replace(meta, truth_path=CONTROLS))
    with open_runs([path], rooms_path) as runs:
        text = html_report(hostile, runs, [replace(hostile, method=f"{HOSTILE}2")])
        assert set(html_report(controls, runs)).isdisjoint(CONTROLS.replace("[2J", ""))
    page = Page(text)
    assert len(page.pictures) == 3 * 2 * 6  # a third of the eight scenes each, in six pictures
    assert all(address.startswith("data:") for address in page.addresses)
    assert page.tags.isdisjoint({"script", "iframe", "form", "object"})
    assert not any(name.startswith("on") or name == "style" for name in page.attributes)
    assert "@import" not in text
    assert len(text) < 600_000
    assert HOSTILE in page.text
    assert {row[0].strip() for row in page.rows} >= set(scores.metrics)
    best, worst = (page.text.split(f"{place} 2 of 8 scenes")[1] for place in ("Best", "Worst"))
    assert f"row {len(scores.ids) - 1} " in best.split("Median")[0]
    assert "row 0 " in worst


def test_the_headline_stands_beside_floor_paper_and_other_methods(tmp_path):
    mine, other = simple_rooms(skills=SKILLS), simple_rooms("other", skills={})
    (table,) = headline_section([mine, other]).tables
    row = next(row for row in table.rows if row.cells[0].value == "Chamfer")
    cells = {name: cell.value for name, cell in zip(table.head, row.cells, strict=True)}
    assert cells.pop("on its scale") == ""
    assert cells == {"score": "Chamfer", "skill": "-0.2", "mine": "0.2000", "floor": "0.1600",
                     "paper †": "0.103", "other": "0.2000"}  # fmt: skip
    elsewhere = simple_rooms("other", digest="0" * 64)
    with refused(OtherTruthError, "other"):
        html_report(mine, beside=[elsewhere])


def test_questions_stand_by_kind_beside_chance_floor_and_people():
    group = {"iqtt_accuracy": make_score("iqtt_accuracy", 1 / 3)}
    kinds = {"other": group, "near-2": group, "<b>": group}
    told = {"by_distractor": kinds, "question_floors": (Floor("other", "trees", 0.591, 2500),)}
    section, *_ = kinds_sections([iqtt_scores("mine", [1, 0, 1], **told)])
    cells = cells_of(section.tables[0])
    assert cells["other"][3:] == ["0.3333", "-0.6300", "0.5910 trees", "0.7329 ± 0.148"]
    assert cells["near-2"][4:] == cells["<b>"][4:] == ["-", "-", "-"]


def test_examples_of_questions_say_what_is_right(truths, tmp_path):
    path, answers = tmp_path / "x.h5", truths.iqtt.with_name("iqtt-test-answers.h5")
    write_answers(path, truths.iqtt, method="m", answer=np.array([0, 1, 2, -1, 1, 0]))
    scores = score([path], answers)
    with open_runs([path], answers) as runs:
        page = Page(html_report(scores, runs))
    right = int(scores.items["iqtt_accuracy"].sum())
    assert f"{right} of {right} questions answered rightly" in page.text
    assert f"{6 - right} of {6 - right} questions answered wrongly" in page.text
    assert page.text.count("no answer was given") == 1
    assert len(page.pictures) == 6 * 4


@pytest.mark.parametrize(
    "scores",
    [
        rooms_scores("one row", {"chamfer": [0.1]}, [0]),
        rooms_scores("none of the headline", {"abs_rel": [0.1, 0.2]}, [0, 1]),
        iqtt_scores("one question", [1.0]),
        iqtt_scores("two answers", [1.0, 0.0], counts={"answers": 2}),
    ],
    ids=lambda scores: scores.method,
)
def test_little_is_a_page_too(scores, tmp_path):
    gone = {name: np.nan * c for name, c in scores.items.items() if name in scores.metrics}
    for shown in (scores, stated(scores, items={**scores.items, **gone})):
        page = Page(html_report(shown))
        assert scores.method in page.text
        assert "nan" not in page.text
