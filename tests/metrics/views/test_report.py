"""The page of scores: what it holds, what stands beside the headline, and what it never does."""

from dataclasses import replace

import numpy as np
import pytest
from jinja2 import UndefinedError
from made_scores import iqtt_scores, rooms_scores, simple_rooms, stated
from pages import Page

from metrics.measures.empty_room import empty_room
from metrics.prediction_writer import RoomPredictionWriter, write_answers
from metrics.report.html import render
from metrics.views.report import BesideError, html_report
from metrics.score_file import Skill
from metrics.scoring.evaluate import score
from metrics.scoring.records import Submission
from scenegen.rooms.reader import RoomsFile

CONTROLS = "\x1b[2J\x9b\u202e\u2066\x07"
HOSTILE = "</title></style><script>alert(1)</script>\"'><img src=http://x.y>&"


def test_the_page_is_whole_escapes_names_and_loads_nothing(rooms_path, tmp_path):
    path = tmp_path / "flat.h5"
    with RoomsFile(rooms_path) as rooms, RoomPredictionWriter(path, rooms_path, method="m") as out:
        for row in range(len(rooms)):  # the later a room, the more its objects stand out
            room = rooms[row]
            camera = room.world_from_camera, room.fov_y_degrees
            empty, _ = empty_room(*camera, *room.depth.shape)
            out.add(row, empty + (row + 1) / len(rooms) * (room.depth - empty))
    found = score([path], rooms_path)
    runs = (Submission(HOSTILE, "0" * 64, HOSTILE),)
    meta = replace(found.meta, truth_path=HOSTILE, truth_given=False, submissions=runs)
    hostile = replace(found, method=HOSTILE, meta=meta)
    text = html_report(hostile, rooms_path, [path], [replace(hostile, method=f"{HOSTILE}2")])
    meta = replace(meta, truth_path=CONTROLS)
    controls = html_report(replace(found, method=CONTROLS, meta=meta), rooms_path, [path])
    assert set(controls).isdisjoint(CONTROLS.replace("[2J", ""))
    page = Page(text)
    pictures = [address for address in page.addresses if address != "data:,"]
    assert len(pictures) == 3 * 2 * 6  # a third of the eight scenes each, in six pictures
    assert all(address.startswith("data:image/webp;base64,") for address in pictures)
    assert page.tags.isdisjoint({"script", "iframe", "form", "object"})
    assert not any(name.startswith("on") or name == "style" for name in page.attributes)
    assert "@import" not in text
    assert len(text) < 500_000
    words = " ".join(page.words)
    assert words.count(HOSTILE) == 7  # as title, head, warning (twice), truth, path and run
    assert {row[0].strip() for row in page.rows} >= {*found.metrics, "noise floor"}
    best, _, worst = (words.split(f"{how} 2 of 8 scenes")[1] for how in ("Best", "Median", "Worst"))
    assert f"row {len(found.ids) - 1} " in best.split("Median")[0]
    assert "row 0 " in worst


def test_the_headline_stands_beside_floor_paper_and_other_methods(tmp_path):
    skills = {"chamfer": Skill(-0.25, -0.5, -0.1, 0.16, "empty_room_chamfer")}
    mine, other = simple_rooms(skills=skills), simple_rooms("other")
    page = Page(html_report(mine, tmp_path, [], [other]))
    head, chamfer = page.rows[0], next(row for row in page.rows if row[0].startswith("Chamfer"))
    cells = dict(zip(head, chamfer, strict=True))
    told = {name: cells[name].split()[0] for name in ("skill", "mine", "floor", "paper †", "other")}
    assert told == {"skill": "-0.2500", "mine": "0.2000", "floor": "0.1600", "paper †": "0.103",
                    "other": "0.2000"}  # fmt: skip
    assert "worse than the floor" in " ".join(page.words)
    elsewhere = simple_rooms("other", digest="0" * 64)
    with pytest.raises(BesideError) as error:
        html_report(mine, tmp_path, [], [elsewhere])
    assert (error.value.where, error.value.found) == (
        "other",
        "scores of truth of digest 000000000000",
    )


def test_questions_stand_by_kind_beside_chance_floor_and_people(tmp_path):
    scores = iqtt_scores("mine", [1, 0, 1])
    (group,) = scores.by_distractor.values()
    scores = stated(scores, by_distractor={"other": group, "near-2": group, "<b>": group})
    page = Page(html_report(scores, tmp_path, []))
    rows = {row[0]: row for row in page.rows if len(row) == 8}
    assert rows["other"][4:] == ["0.3333", "0.1850", "0.5910 outline-trees, 5,000 labels",
                                 "0.7329 ± 0.148"]  # fmt: skip
    assert rows["near-2"][6] == "0.3333 chance, as no probe was measured"
    assert rows["near-2"][7] == rows["<b>"][7] == "-"


def test_examples_of_questions_say_what_is_right(truths, tmp_path):
    path = tmp_path / "x.h5"
    write_answers(path, truths.iqtt, method="m", answer=np.array([0, 1, 2, -1, 1, 0]))
    found = score([path], truths.iqtt.with_name("iqtt-test-answers.h5"))
    page = Page(html_report(found, truths.iqtt.with_name("iqtt-test-answers.h5"), [path]))
    words = " ".join(" ".join(page.words).split())
    right = int(found.items["iqtt_accuracy"].sum())
    assert f"{right} of {right} questions answered rightly" in words
    assert f"{6 - right} of {6 - right} questions answered wrongly" in words
    assert words.count("no answer was given") == 1
    assert sum(address.startswith("data:image") for address in page.addresses) == 6 * 4


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
        text = html_report(shown, tmp_path, [])
        assert scores.method in " ".join(Page(text).words)
        assert "nan" not in text


def test_a_page_that_lacks_a_value_is_an_error():
    with pytest.raises(UndefinedError):
        render("leaderboard.html")
