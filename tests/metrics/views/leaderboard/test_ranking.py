"""What stands where in a leaderboard, and what never ranks."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_scores import DIGEST, iqtt_scores, make_score, rooms_scores, stated
from refusals import refused

from metrics.views.leaderboard.floors import FloorError
from metrics.views.leaderboard.ranking import LeaderboardError, leaderboard
from metrics.views.paper import TABLES
from metrics.score_file import Skill
from metrics.scoring.floors import Floor
from metrics.scoring.known_tests import KnownTest
from metrics.scoring.metric_names import UnknownMetricError


@pytest.fixture(autouse=True)
def _no_floors(monkeypatch):
    """Kinds of questions are taken as not measured, except where a test says otherwise."""
    monkeypatch.setattr("metrics.scoring.floors.FLOORS", ())


SCENES = [0, 0, 1, 1]
PAPER = ("task", "all", "none")


def rooms(name, chamfer=0.2, mse=0.02, **other):
    columns = {"chamfer": np.ones(4) * chamfer, "hausdorff": [0.5] * 4, "mse_depth": [mse] * 4}
    return rooms_scores(name, columns, SCENES, path=Path(f"{name}.json"), **other)


def by_label(table):
    return {row.label: row for row in table.rows}


def test_ranks_and_best_cells():
    files = [rooms("b", 0.3, 0.01), rooms("a", 0.1, 0.02), rooms("c", 0.3, 0.04)]
    table = leaderboard(files, paper="none")[0]
    assert [(row.rank, row.label) for row in table.rows] == [("1", "a"), ("2", "b"), ("2", "c")]
    assert {row.kind for row in table.rows} == {"ranked"}
    best = [[cell.best for cell in row.cells] for row in table.rows]
    assert best == [[True, True, False], [False, True, True], [False, True, False]]
    assert table.columns[0] == "Chamfer ↓ (scene unit)"
    assert by_label(table)["a"].cells[0].rest == " [0.1000, 0.1000]"
    assert table.title == f"Rooms, truth {DIGEST[:12]}"
    assert len(leaderboard(files, paper="none")) == 1


def test_higher_is_better_where_it_is():
    files = [iqtt_scores("low", [1, 0, 0, 0]), iqtt_scores("high", [1, 1, 0, 1])]
    (table,) = leaderboard(files, paper="none")
    shown = [(row.label, row.cells[0].best) for row in table.rows]
    assert shown == [("high", 1), ("low", 0), ("floor: chance, as no probe was measured", 0)]
    assert table.columns == ("IQTT accuracy: skill ↑", "IQTT accuracy ↑ (fraction)")
    assert table.title == f"3D-IQTT, mirror questions, truth {DIGEST[:12]}"
    assert "4 questions; chance is 0.3333." in table.notes


def test_what_is_not_comparable_is_never_ranked_nor_best():
    part = rooms("part", 0.001, 0.001, comparable=False)
    for files in ([part, rooms("a")], [rooms("a"), part]):
        table = leaderboard(files, paper="none")[0]
        last = table.rows[-1]
        assert (last.rank, last.label, last.kind) == ("", "part ‡", "incomparable")
        assert not any(cell.best for cell in last.cells)
        assert [cell.best for cell in table.rows[0].cells] == [True] * 3
        assert any(note.startswith("‡ not comparable") for note in table.notes)
    alone = leaderboard([part], paper="none")[0]
    assert not any(cell.best for cell in alone.rows[0].cells)


def test_test_sets_are_never_ranked_together():
    other = "f" * 64
    files = [rooms("a", 0.3), rooms("b", 0.1, truth=other, digest=other), rooms("c", 0.2)]
    first, second = leaderboard(files, paper="none")
    assert not any(note.startswith("Not ranked with") for note in (*first.notes, *second.notes))
    assert [(row.rank, row.label) for row in first.rows] == [("1", "c"), ("2", "a")]
    assert [(row.rank, row.label) for row in second.rows] == [("1", "b")]
    # One fingerprint, two tasks: still two test sets.
    assert len(leaderboard([rooms("a"), iqtt_scores("b", [1])], paper="none")) == 2


def test_truths_of_one_request_but_other_bits_are_not_ranked_together():
    first, second = leaderboard([rooms("a"), rooms("b", digest="f" * 64)], paper="none")
    assert [len(table.rows) for table in (first, second)] == [1, 1]
    for table, other in ((first, "f" * 12), (second, DIGEST[:12])):
        assert any(note.startswith(f"Not ranked with truth {other}") for note in table.notes)


def test_known_test_sets_bear_their_name(monkeypatch):
    known = KnownTest("rooms-test", "rooms", DIGEST, 3, "scenegen render")
    monkeypatch.setattr("metrics.scoring.known_tests.KNOWN_TESTS", (known,))
    assert leaderboard([rooms("a")], paper="none")[0].title == "Rooms, rooms-test"


def test_files_that_claim_the_whole_test_set_must_agree_on_it():
    a, b = rooms("a"), rooms("b")
    other = replace(b, columns={**b.columns, "row": np.array([0, 1, 2, 4])})
    with refused(LeaderboardError, "b.json", found="4 rows", expected="the 4 of a.json"):
        leaderboard([a, other])
    assert leaderboard([a, stated(other, comparable=False)])
    turned = {name: column[..., ::-1] for name, column in b.columns.items()}
    assert leaderboard([a, replace(b, columns=turned)])


def test_scores_that_are_missing_leave_a_hole():
    a, b = rooms("a"), rooms("b")
    less = replace(b, columns={k: v for k, v in b.columns.items() if k != "chamfer"})
    table = leaderboard([less, a], paper="none")[0]
    assert [(row.rank, row.label) for row in table.rows] == [("1", "a"), ("", "b")]
    assert table.rows[1].cells[0].value == "-"
    assert table.rows[1].cells[2].best
    table = leaderboard([less, a], ["mse_depth", "normal_mean_degrees"], paper="none")[0]
    assert [cell.value for cell in table.rows[0].cells] == ["0.02000", "-"]
    with pytest.raises(UnknownMetricError):
        leaderboard([a], ["cd"])


def test_labels_tell_runs_and_claims():
    runs = [[0.198] * 4, [0.2] * 4, [0.202] * 4]
    several = rooms("a", np.array(runs), runs=3, alignment="scale_shift")
    table = leaderboard([several, rooms("b")], paper="none")[0]
    row = by_label(table)["a (3 runs; claims depth when scaled and shifted)"]
    assert row.cells[0].rest.startswith(" ± 0.0020 [")


def skilled(name, chamfer=0.2, **other):
    """Rooms with a skill over a floor of 0.4, and a noise floor."""
    columns = {"hausdorff": [0.3] * 4, "chamfer": [chamfer] * 4}
    skills = {"chamfer": Skill(1 - chamfer / 0.4, -0.5, 0.9, 0.4, "empty_room_chamfer")}
    told = {"skills": skills, "noise_floors": {"chamfer": 0.0123}, "path": Path(f"{name}.json")}
    return rooms_scores(name, columns, SCENES, **{**told, **other})


def test_skill_stands_before_the_score_and_floors_below_the_methods():
    names = ["hausdorff", "chamfer"]
    table = leaderboard([skilled("worse", 0.3), skilled("better")], names, paper="none")[0]
    heads = ("Hausdorff ↓ (scene unit)", "Chamfer ↓ (scene unit)")
    assert table.columns == (*heads, "Chamfer: skill ↑")
    rows = [(row.rank, row.label, row.kind) for row in table.rows]
    assert rows == [
        ("1", "better", "ranked"),  # the first column is tied, the second decides
        ("1", "worse", "ranked"),
        ("", "floor: empty room", "floor"),
        ("", "noise floor", "floor"),
    ]
    cells = [[cell.value for cell in row.cells] for row in table.rows]
    assert cells[0][2] == "0.5000"
    assert cells[2:] == [["-", "0.4000", "0"], ["-", "0.01230", "-"]]
    assert table.rows[0].cells[2].rest == " [-0.5000, 0.9000]"
    assert not any(cell.best for row in table.rows[2:] for cell in row.cells)
    right = Skill(0.25, 0.1, 0.4, 0.5, "outline")
    table = leaderboard([iqtt_scores("q", [1, 0], skills={"iqtt_accuracy": right})])[0]
    assert table.columns[0] == "IQTT accuracy: skill ↑"
    rows = {row.label: [cell.value for cell in row.cells] for row in table.rows}
    assert rows["floor: outline"] == ["0", "0.5000"]
    assert rows["floor: chance"] == ["-", "0.3333"]


def test_the_floor_by_view_angle_is_the_empty_rooms_at_that_angle():
    items = {"view_angle_degrees": np.array([0, 35, 0, 35])}
    items["empty_room_chamfer"] = np.array([0.1, 0.5, 0.3, 0.7])
    file = rooms("a")
    file = stated(replace(file, columns={**file.columns, **items}), by_view_angle=angles(0.2))
    _, table = leaderboard([file], paper="none")
    floor = by_label(table)["floor: empty room"]
    assert [cell.value for cell in floor.cells] == ["0.2000", "-", "0.6000"]  # 0, 5 and 35 degrees


def relief(name, iou, floor):
    """Rooms whose relief has a floor of its own, as it is the same prediction for another scene."""
    value = (iou - floor) / (1 - floor)
    skills = {"relief_iou": Skill(value, None, None, floor, "other_scene_relief_iou")}
    return rooms_scores(name, {"relief_iou": [iou] * 4}, SCENES, skills=skills)


def test_the_skill_of_relief_ranks_and_its_floor_stands_beside_each_score():
    guess, seen = relief("guess", 0.37, 0.36), relief("seen", 0.35, 0.2)
    table = leaderboard([guess, seen], paper="none")[0]
    assert table.columns == ("Relief IoU: skill ↑", "Relief IoU ↑ (fraction)")
    assert [row.label for row in table.rows] == ["seen", "guess", "floor: empty room"]
    assert [row.cells[1].rest.split("floor ")[-1] for row in table.rows[:2]] == ["0.2000", "0.3600"]
    assert [cell.value for cell in table.rows[2].cells] == ["0", "-"]


def test_what_is_too_wide_becomes_two_tables():
    names = ("chamfer", "hausdorff", "mse_depth", "relief_iou")
    columns = {name: [0.2] * 4 for name in names}
    skills = {name: Skill(0.5, None, None, 0.4, f"empty_room_{name}") for name in names[:3]}
    ranking, scores = leaderboard([rooms_scores("a", columns, SCENES, skills=skills)], paper="none")
    assert ranking.columns == tuple(f"{n}: skill ↑" for n in ("Chamfer", "Hausdorff", "MSE-depth"))
    assert scores.columns[0] == "Relief IoU ↑ (fraction)"
    assert [table.rows[0].rank for table in (ranking, scores)] == ["1", ""]


def test_a_test_set_has_one_floor():
    """Which every comparable file of it states; another one is forged, or of another release."""
    skill = Skill(0.9, 0.8, 1.0, 2.0, "empty_room_chamfer")
    with refused(FloorError, "b.json: skills.chamfer.floor", "2.0", "0.4, as in a.json"):
        leaderboard([skilled("a"), skilled("b", skills={"chamfer": skill})])
    with refused(FloorError, "b.json: meta.noise_floors.chamfer", "0.1"):
        leaderboard([skilled("a"), skilled("b", noise_floors={"chamfer": 0.1})])
    part = skilled("b", skills={"chamfer": skill}, comparable=False)
    assert leaderboard([part, skilled("a")])[0].rows[2].cells[-1].value != "2.000"


def test_a_submission_stands_there_once():
    a = rooms("a")
    for other in (a, replace(a, method="b", path=Path("b.json"))):
        with refused(LeaderboardError, str(other.path), found="a.json", expected="once"):
            leaderboard([a, other])
    assert leaderboard([a, replace(a, meta=replace(a.meta, truth_digest="f" * 64))])


def by_kind(*rights):
    kinds = ("matched", "near")
    return {
        kind: {"iqtt_accuracy": make_score("iqtt_accuracy", right)}
        for kind, right in zip(kinds, rights, strict=True)
    }


def test_questions_by_kind_with_the_floors_of_each_kind(monkeypatch):
    table = (Floor("near", "outline-trees", 1000, 0.6, 0.5, 0.7),)
    table += (Floor("matched", "outline-trees", 1000, 0.35, 0.3, 0.4),)
    monkeypatch.setattr("metrics.scoring.floors.FLOORS", (*table, replace(table[0], kind="other")))
    file = iqtt_scores("a", [1, 0, 1, 0], by_distractor=by_kind(0.3, 0.7))
    _, kinds, floors = leaderboard([file], paper="none")
    assert kinds.columns == ("matched", "near")
    rows = {row.label: [cell.value for cell in row.cells] for row in kinds.rows}
    assert rows == {
        "a": ["0.3000", "0.7000"],
        "floor: best": ["0.3333", "0.6000"],
        "floor: chance": ["0.3333", "0.3333"],
    }
    assert floors.columns == ("near", "matched")
    (row,) = floors.rows
    assert (row.label, row.kind) == ("outline-trees, 1,000 labels", "floor")
    assert [cell.value + cell.rest for cell in row.cells] == [
        "0.6000 [0.5000, 0.7000]",
        "0.3500 [0.3000, 0.4000]",
    ]


def angles(shift):
    return {str(a): {"chamfer": make_score("chamfer", a / 100 + shift)} for a in (5, 35, 0)}


def test_scores_by_view_angle_keep_the_order_of_the_ranking():
    files = [rooms("b", 0.3, by_view_angle=angles(0.0)), rooms("a", by_view_angle=angles(0.1))]
    _, table = leaderboard(files, paper="none")
    assert table.columns == ("0°", "5°", "35°")
    assert [(row.rank, row.label) for row in table.rows] == [("", "a"), ("", "b")]
    assert [cell.best for cell in table.rows[1].cells] == [True] * 3
    assert table.rows[1].cells[0].value == "0"


def shown_figures(board):
    """Values of the paper's rows, by table number where a row tells it."""
    rows = [row for table in board for row in table.rows if row.kind == "reported"]
    assert all(row.label.endswith(" †") for row in rows)
    assert not any(row.rank or cell.best for row in rows for cell in row.cells)
    return [cell.value for row in rows for cell in row.cells if cell.value != "-"]


@pytest.mark.parametrize("files", [[], ["rooms"], ["iqtt"], ["rooms", "iqtt"]])
def test_every_figure_of_the_paper_is_shown_marked_and_unranked(files):
    made = {"rooms": rooms("a", 0.11, by_view_angle=angles(0.2)), "iqtt": iqtt_scores("b", [1, 0])}
    board = leaderboard([made[name] for name in files], paper="all")
    shown = shown_figures(board)
    for figure in (figure for table in TABLES for figure in table.figures):
        assert figure.text in shown
    assert len(shown) >= sum(len(table.figures) for table in TABLES)
    assert all(row.cells[0].best for t in board for row in t.rows if row.rank == "1")
    if files:
        ranking = board[0]
        assert ranking.rows[0].kind == "ranked"
        if files[0] == "iqtt":  # of mirror images, which the paper's questions are not
            return
        assert ranking.rows[-1].kind == "reported"
        assert any("as reported, on the authors' data, so not ranked" in n for n in ranking.notes)
        assert any("no unit of length" in n for n in ranking.notes) == (files[0] == "rooms")


def test_only_the_tables_of_the_task_are_shown_unless_asked_for():
    files = [rooms("a", by_view_angle=angles(0.2))]
    values = {paper: shown_figures(leaderboard(files, paper=paper)) for paper in PAPER}
    accuracies = {f.text for f in TABLES[2].figures}
    assert accuracies.isdisjoint(values["task"])
    assert {f.text for f in TABLES[1].figures} <= set(values["task"])
    assert accuracies <= set(values["all"])
    assert values["none"] == []


def test_figures_of_other_scores_or_angles_do_not_slip_into_a_ranking():
    board = leaderboard([rooms("a", by_view_angle=angles(0.2))])
    ranking, turned = board[:2]
    assert len(by_label(ranking)) == 1 + 4
    assert by_label(ranking)["PTN, ShapeNet scenes (Table 1) †"].cells[0].value == "0.181"
    row = by_label(turned)["Pix2Shape, Shape scenes (Table 2) †"]
    assert [cell.value for cell in row.cells] == ["-", "0.098", "0.112"]
    alone = leaderboard([rooms("a")], paper="none")[0]
    assert [row.kind for row in alone.rows] == ["ranked"]
    other = {"other": iqtt_scores("a", [1]).by_distractor["mirror"]}
    for kinds in (other, {}):
        people = leaderboard([iqtt_scores("a", [1], by_distractor=kinds)])[0]
        assert sum(row.kind == "reported" for row in people.rows) == len(TABLES[2].figures)
    mirror, alone, *_ = leaderboard([iqtt_scores("a", [1])])  # of which the paper has no figures
    assert {row.kind for row in mirror.rows} == {"ranked", "floor"}
    assert "Table 3" in alone.title
    cell = by_label(people)["Human Evaluation, 3D-IQTT, 0 labels (Table 3) †"].cells[-1]
    assert (cell.value, cell.rest) == ("0.7329", " ± 0.148")
