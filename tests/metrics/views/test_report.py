"""Tables and reports in all formats, with texts that would like to break them."""

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
from metrics.views.page import Section, html_page
from metrics.views.report import html_report
from metrics.views.score_tables import (
    all_scores,
    group_tables,
    main_table,
    side_by_side,
    unit_warning,
    warnings_of,
    write_csv,
)
from metrics.views.table import (
    Cell,
    Table,
    make_row,
    make_table,
    to_latex,
    to_markdown,
)
from scenegen.common.text_table import printable, with_interval
from scenegen.rooms.reader import RoomsFile

HOSTILE = [
    "a | b",
    "under_score & amp; 100% #1 $x^2$ {braces} ~",
    "<script>alert(1)</script>",
    "\"><img src=x onerror='alert(1)'>",
    "two\nlines\r\n| --- |",
    "\\input{/etc/passwd} \\\\ \\end{tabular}",
    "**bold** `code` [link](javascript:alert(1)) ![x](http://x.y/z.png)",
    "日本語 🎲 é",
    "\u202eright to left\u2066",
    "\x00\x1b[2J\ud800",
    "",
    "</title></style><!--",
]


@pytest.fixture(scope="module")
def hostile():
    """A table of which every part is hostile."""
    rows = [make_row([str(i), text, Cell(text, text)]) for i, text in enumerate(HOSTILE)]
    rows.append(make_row(["", "the room", "0"], "baseline"))
    head = ("#", HOSTILE[0], HOSTILE[2])
    return Table(HOSTILE[5], head, tuple(rows), tuple(HOSTILE), named_by=1)


def test_html_holds_texts_of_others_as_texts(hostile):
    page = Page(html_page(hostile.title, [Section(HOSTILE[3], HOSTILE, tables=[hostile])]))
    assert page.tags.isdisjoint({"script", "img", "iframe", "form", "object"})
    assert not any(name.startswith("on") or name == "src" for name in page.attributes)
    assert page.addresses == ["data:,"]
    assert set(map(len, page.rows)) == {3}
    assert [row[1] for row in page.rows[1:-1]] == [printable(t, keep="\n\t") for t in HOSTILE]


def test_markdown_rows_have_all_their_cells_and_no_markup_of_others(hostile):
    text = to_markdown(HOSTILE[2], [hostile], HOSTILE)
    assert "<" not in text
    rows = [line for line in text.splitlines() if line.startswith("|")]
    assert len(rows) == 2 + len(hostile.rows)
    assert {len(re.findall(r"(?<!\\)(?:\\\\)*\|", row)) for row in rows} == {4}
    assert r"\[link\](javascript:alert(1)) !\[x\]" in text


def test_latex_has_balanced_braces_and_all_its_cells(hostile):
    text = to_latex([hostile, make_table("simple", ["a"], [["b"]])])
    bare = re.sub(r"\\[\\{}%$#_&]", "", text.split("\n", 1)[1])
    assert bare.count("{") == bare.count("}")
    assert not re.search(r"(?<!\{)%", bare)  # but for \resizebox{...}{!}{%
    assert {"$", "#"}.isdisjoint(bare)
    assert {"\\input", "\\end{tabular} "}.isdisjoint(re.findall(r"\\\w+", text))
    tabular = text.split(r"\begin{tabular}{rlc}")[1].split(r"\end{tabular}")[0]
    ends = [line for line in tabular.splitlines() if line.endswith(r" \\")]
    assert {len(re.findall(r"(?<!\\)&", row)) for row in ends} == {2}
    assert len(ends) == 1 + len(hostile.rows)
    assert tabular.count(r"\midrule") == 2, "one below the head, one before the baseline"


CONTROLS = "\x1b[2J\x9b\u202e\u2066\x07"
SCRIPT = "</title></style><script>alert(1)</script>\"'><img src=http://x.y>&"
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


def test_questions_have_the_baseline_of_their_kind():
    floors = (Floor("mirror", "outline", 0.5, 2500),)
    accuracy = {"iqtt_accuracy": Skill(0.0, None, None, 0.5, "outline")}
    group = {"mirror": {"iqtt_accuracy": make_score("iqtt_accuracy", 1 / 3)}}
    by_kind, by_answer = {"skills": accuracy, "by_distractor": group}, {"2": group["mirror"]}
    scores = iqtt_scores("a", [1, 0], **by_kind, by_position=by_answer, question_floors=floors)
    row = cells_of(main_table(scores))["iqtt_accuracy"]
    assert (row[3], row[4:]) == ("0.5 outline", ["0", "baseline itself"])
    kinds, places = group_tables(scores)
    assert list(cells_of(places)) == ["C"]
    assert cells_of(kinds) == {"mirror": ["0.3333", "2", "-0.3333", "0.5000 outline"]}


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
    runs = (Submission(SCRIPT, "0" * 64, SCRIPT),)
    meta = replace(scores.meta, truth_path=SCRIPT + CONTROLS, submissions=runs)
    hostile = replace(scores, method=SCRIPT, meta=replace(meta, truth_given=False))
    with open_runs([path], rooms_path) as runs:
        text = html_report(hostile, runs, [replace(hostile, method=f"{SCRIPT}{CONTROLS}")])
    assert set(text).isdisjoint(CONTROLS.replace("[2J", ""))
    page = Page(text)
    assert len(page.pictures) == 3 * 2 * 6  # a third of the eight scenes each, in six pictures
    assert all(address.startswith("data:") for address in page.addresses)
    assert page.tags.isdisjoint({"script", "iframe", "form", "object"})
    assert not any(name.startswith("on") for name in page.attributes)
    assert SCRIPT in page.text
    assert {row[0].strip() for row in page.rows} >= set(scores.metrics)
    best, worst = (page.text.split(f"{place} 2 of 8 scenes")[1] for place in ("Best", "Worst"))
    assert f"row {len(scores.ids) - 1} " in best.split("Median")[0]
    assert "row 0 " in worst


def test_other_methods_stand_beside_on_the_same_truth_alone():
    mine, other = simple_rooms(skills=SKILLS), simple_rooms("other", skills={})
    table = side_by_side([mine, other])
    assert table.head == ("", "mine", "other", "baseline")
    assert cells_of(table)["skill of chamfer"] == ["-0.2 [-0.5, -0.1]", "-", "empty room"]
    page = Page(html_report(mine, beside=[other]))
    assert ["hausdorff", "down", "0.5000"] in [row[:3] for row in page.rows]
    with refused(OtherTruthError, "other"):
        html_report(mine, beside=[simple_rooms("other", digest="0" * 64)])


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


def test_examples_of_questions_say_what_is_right(truths, tmp_path):
    path, answers = tmp_path / "x.h5", truths.iqtt.with_name("iqtt-test-answers.h5")
    write_answers(path, truths.iqtt, method="m", answer=np.array([0, 1, 2, -1, 1, 0]))
    scores = score([path], answers)
    with open_runs([path], answers) as runs:
        page = Page(html_report(scores, runs))
    right = int(scores.items["iqtt_accuracy"].sum())
    for count, how in ((right, "correct"), (6 - right, "wrong")):
        assert f"{count} of {count} {how} responses" in page.text
    assert len(page.pictures) == 6 * 4


@pytest.mark.parametrize(("factor", "shown"), [(1.0, True), (1000.0, False), (0.4, False)])
def test_depth_in_another_unit_has_a_warning_and_no_skill(truths, tmp_path, factor, shown):
    with RoomsFile(truths.rooms) as rooms, RoomPredictionWriter(
        tmp_path / "p.h5", truths.rooms, method="m"
    ) as out:  # fmt: skip
        noise = np.random.default_rng(0).uniform(0.99, 1.01, len(rooms))
        for row in range(len(rooms)):
            out.add(row, rooms[row].depth * factor * noise[row])
    scores = score([tmp_path / "p.h5"], truths.rooms)
    assert ("skill" in main_table(scores).head) == shown
    assert bool(unit_warning(scores)) != shown
    assert unit_warning(scores) == warnings_of(scores)[: len(unit_warning(scores))]
