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
from metrics.views.report import html_report
from metrics.views.score_tables import (
    all_scores,
    group_tables,
    main_table,
    notes_of,
    side_by_side,
    text_report,
    title_of,
    write_csv,
)
from scenegen.common.text_table import with_interval
from scenegen.rooms.reader import RoomsFile

CONTROLS = "\x1b[2J\x9b\u202e\u2066\x07"
HOSTILE = "</title></style><script>alert(1)</script>\"'><img src=http://x.y>&"
SKILLS = {"chamfer": Skill(-0.25, -0.5, -0.1, 0.16, "empty_room_chamfer")}


def test_each_main_metric_has_value_baseline_and_skill_in_one_row():
    scores = simple_rooms(skills=SKILLS)
    assert cells_of(main_table(scores)) == {
        "mse_depth": ["down", *_value(scores, "mse_depth"), "-", "-", ""],
        "chamfer": ["down", "0.2000", "[0.2000, 0.2000]", "0.1600 empty room", "-0.2",
                    "[-0.5, -0.1]"],
        "hausdorff": ["down", "0.5000", "[0.5000, 0.5000]", "-", "-", ""],
    }  # fmt: skip
    itself = simple_rooms(skills={"chamfer": Skill(0.0, 0.0, 0.0, 0.2, "empty_room_chamfer")})
    assert cells_of(main_table(itself))["chamfer"][-2:] == ["0", "baseline itself"]
    cells = cells_of(all_scores(scores))
    for name in scores.metrics:
        assert cells[name][:2] == _value(scores, name)
    assert cells["chamfer"][2:] == ["-", "0.1600", "scene unit", "lower"]
    several = rooms_scores("a", {"chamfer": [[0.1, 0.2], [0.2, 0.3]]}, [0, 1], runs=2)
    assert cells_of(main_table(several))["chamfer"][1] == "0.20 ± 0.07"


def _value(scores, name):
    value = scores.metrics[name]
    return [*with_interval(value.value, value.low, value.high)]


def test_what_bench_score_prints_is_short_and_begins_with_warnings():
    columns = {f"abs_rel{ending}": [0.1, 0.3, 0.2, 0.2] for ending in ("", "_after_scale")}
    columns |= {f"{name}{ending}": [0.5] * 4 for name in ("rmse", "delta_1")
                for ending in ("", "_after_scale")}  # fmt: skip
    columns |= dict.fromkeys(("mse_depth", "chamfer", "hausdorff", "shape_error"), [0.2] * 4)
    skills = {
        "chamfer": SKILLS["chamfer"],
        "shape_error": Skill(0, 0, 0, 0.2, "cut_out_shape_error"),
    }
    scores = rooms_scores("m", columns, [0, 0, 1, 1], skills=skills, truth_given=False)
    lines = text_report(scores, width=100).splitlines()
    assert len(lines) <= 25
    assert max(map(len, lines)) <= 100
    assert (
        lines[0]
        == "m on rooms.h5: 4 images, 2 scenes   alignment: none (metric)   unit: scene unit"
    )
    assert lines[1].startswith("WARNING  not comparable: ")
    table = [line.split()[:2] for line in lines if line.startswith("  ") and "[" in line]
    assert table[:2] == [["abs_rel", "down"], ["delta_1", "up"]]
    notes = notes_of(scores)
    assert len(notes) == 5
    assert "none 0.2000 | scale 0.2000;" in next(n for n in notes if n.startswith("abs_rel by"))
    baselines = next(note for note in notes if note.startswith("baselines: "))
    assert ("empty room = " in baselines, "cut-out = " in baselines) == (True, True)
    assert "shuffled" not in baselines
    assert scores.meta.truth_digest[:12] in notes[-1]
    whole = text_report(scores, whole=True)
    assert all(name in whole for name in ("all metrics", "depth after each alignment"))


def test_questions_have_the_baseline_of_their_kind():
    floors = (Floor("mirror", "outline", 0.5, 2500),)
    accuracy = {"iqtt_accuracy": Skill(0.0, None, None, 0.5, "outline")}
    group = {"mirror": {"iqtt_accuracy": make_score("iqtt_accuracy", 1 / 3)}}
    by_kind, by_answer = {"skills": accuracy, "by_distractor": group}, {"2": group["mirror"]}
    scores = iqtt_scores("a", [1, 0], **by_kind, by_position=by_answer, question_floors=floors)
    row = cells_of(main_table(scores))["iqtt_accuracy"]
    assert (row[3], row[4:]) == ("0.5 outline", ["0", "baseline itself"])
    assert any("chance is 0.33" in note for note in notes_of(scores))
    kinds, places = group_tables(scores)
    assert list(cells_of(places)) == ["C"]
    assert cells_of(kinds) == {"mirror": ["0.3333", "2", "-0.3333", "0.5000 outline"]}
    known = iqtt_scores("a", [1, 0], kinds=["mirror", "near"])
    assert "iqtt floors rooms.h5" in notes_of(known)[0]
    assert "by kind of question" in text_report(known)
    assert "by kind of question" not in text_report(iqtt_scores("a", [1, 0]))


def test_titles_say_what_was_scored():
    assert title_of(iqtt_scores("many", [1, 0], runs=3)) == (
        "many on rooms.h5: 2 questions, mean of 3 runs"
    )
    fitted = simple_rooms(alignment="scale", truth_path="a/b\\c.h5")
    assert title_of(fitted).split("   ")[:2] == [
        "mine on c.h5: 4 images, 2 scenes",
        "alignment: scale (fitted to the truth of each image)",
    ]


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


def test_other_methods_and_the_paper_stand_on_the_page():
    mine, other = simple_rooms(skills=SKILLS), simple_rooms("other", skills={})
    table = side_by_side([mine, other])
    assert table.head == ("", "mine", "other", "baseline")
    assert cells_of(table)["skill of chamfer"] == ["-0.2 [-0.5, -0.1]", "-", "empty room"]
    page = Page(html_report(mine, beside=[other]))
    assert ["hausdorff", "down", "0.5000"] in [row[:3] for row in page.rows]
    rows = [row for row in page.rows if row[:3] == ["Pix2Shape", "Shape scenes", "35°"]]
    assert rows == [["Pix2Shape", "Shape scenes", "35°", "-", "2", "0.112", "0.191", "0.021"]]
    elsewhere = simple_rooms("other", digest="0" * 64)
    with refused(OtherTruthError, "other"):
        html_report(mine, beside=[elsewhere])
    group = {"iqtt_accuracy": make_score("iqtt_accuracy", 1 / 3)}
    people = iqtt_scores("mine", [1, 0, 1], by_distractor={"other": group})
    rows = [row for row in Page(html_report(people)).rows if row[0] == "Human Evaluation"]
    assert rows[0][-1] == "0.7329 ± 0.148"
    assert "Human Evaluation" not in html_report(iqtt_scores("mine", [1, 0, 1]))


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
