"""What stands where in a leaderboard, and what never ranks."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_scores import DIGEST, iqtt_scores, rooms_scores
from refusals import refused

from metrics.leaderboard.paper_tables import TABLES
from metrics.leaderboard.ranking import LeaderboardError, leaderboard
from metrics.score_file import Score
from metrics.scoring.known_tests import KnownTest
from metrics.scoring.metric_names import UnknownMetricError

SCENES = [0, 0, 1, 1]


def rooms(name, chamfer=0.2, mse=0.02, **other):
    columns = {"chamfer": [chamfer] * 4, "hausdorff": [0.5] * 4, "mse_depth": [mse] * 4}
    return rooms_scores(name, columns, SCENES, path=Path(f"{name}.json"), **other)


def by_label(table):
    return {row.label: row for row in table.rows}


def test_ranks_and_best_cells():
    files = [rooms("b", 0.3, 0.01), rooms("a", 0.1, 0.02), rooms("c", 0.3, 0.04)]
    table = leaderboard(files, paper=False)[0]
    assert [(row.rank, row.label) for row in table.rows] == [("1", "a"), ("2", "b"), ("2", "c")]
    assert {row.kind for row in table.rows} == {"ranked"}
    best = [[cell.best for cell in row.cells] for row in table.rows]
    assert best == [[True, True, False], [False, True, True], [False, True, False]]
    assert table.columns[0] == "Chamfer ↓ (scene unit)"
    assert by_label(table)["a"].cells[0].rest == " [0.0900, 0.1100]"
    assert table.title == f"Rooms, truth {DIGEST[:12]}"
    assert len(leaderboard(files, paper=False)) == 1


def test_higher_is_better_where_it_is():
    files = [iqtt_scores("low", [1, 0, 0, 0]), iqtt_scores("high", [1, 1, 0, 1])]
    (table,) = leaderboard(files, paper=False)
    assert [(row.label, row.cells[0].best) for row in table.rows] == [("high", 1), ("low", 0)]
    assert table.columns == ("IQTT accuracy ↑ (fraction)",)
    assert "4 questions; chance is 0.3333." in table.notes


def test_what_is_not_comparable_is_never_ranked_nor_best():
    part = rooms("part", 0.001, 0.001, comparable=False)
    for files in ([part, rooms("a")], [rooms("a"), part]):
        table = leaderboard(files, paper=False)[0]
        last = table.rows[-1]
        assert (last.rank, last.label, last.kind) == ("", "part ‡", "incomparable")
        assert not any(cell.best for cell in last.cells)
        assert [cell.best for cell in table.rows[0].cells] == [True] * 3
        assert any(note.startswith("‡ not comparable") for note in table.notes)
    alone = leaderboard([part], paper=False)[0]
    assert not any(cell.best for cell in alone.rows[0].cells)


def test_test_sets_are_never_ranked_together():
    other = "f" * 64
    files = [rooms("a", 0.3), rooms("b", 0.1, truth=other, digest=other), rooms("c", 0.2)]
    first, second = leaderboard(files, paper=False)
    assert not any(note.startswith("Not ranked with") for note in (*first.notes, *second.notes))
    assert [(row.rank, row.label) for row in first.rows] == [("1", "c"), ("2", "a")]
    assert [(row.rank, row.label) for row in second.rows] == [("1", "b")]
    # One fingerprint, two tasks: still two test sets.
    assert len(leaderboard([rooms("a"), iqtt_scores("b", [1])], paper=False)) == 2


def test_truths_of_one_request_but_other_bits_are_not_ranked_together():
    first, second = leaderboard([rooms("a"), rooms("b", digest="f" * 64)], paper=False)
    assert [len(table.rows) for table in (first, second)] == [1, 1]
    for table, other in ((first, "f" * 12), (second, DIGEST[:12])):
        assert any(note.startswith(f"Not ranked with truth {other}") for note in table.notes)


def test_known_test_sets_bear_their_name(monkeypatch):
    known = KnownTest("rooms-test", "rooms", DIGEST, 3, "scenegen render")
    monkeypatch.setattr("metrics.scoring.known_tests.KNOWN_TESTS", (known,))
    assert leaderboard([rooms("a")], paper=False)[0].title == "Rooms, rooms-test"


def test_files_that_claim_the_whole_test_set_must_agree_on_it():
    a, b = rooms("a"), rooms("b")
    other = replace(b, items={**b.items, "row": np.array([0, 1, 2, 4])})
    with refused(LeaderboardError, "b.json", found="4 rows", expected="the 4 of a.json"):
        leaderboard([a, other])
    assert leaderboard([a, replace(other, comparable=False)])
    turned = {name: column[::-1] for name, column in b.items.items()}
    assert leaderboard([a, replace(b, items=turned)])


def test_scores_that_are_missing_leave_a_hole():
    a, b = rooms("a"), rooms("b")
    less = replace(b, metrics={k: v for k, v in b.metrics.items() if k != "chamfer"})
    table = leaderboard([less, a], paper=False)[0]
    assert [(row.rank, row.label) for row in table.rows] == [("1", "a"), ("", "b")]
    assert table.rows[1].cells[0].value == "-"
    assert table.rows[1].cells[2].best
    table = leaderboard([less, a], ["mse_depth", "normal_mean_degrees"], paper=False)[0]
    assert [cell.value for cell in table.rows[0].cells] == ["0.02000", "-"]
    with pytest.raises(UnknownMetricError):
        leaderboard([a], ["cd"])


def test_labels_tell_runs_and_claims():
    several = rooms("a", runs=3, alignment="scale_shift")
    table = leaderboard([several, rooms("b")], paper=False)[0]
    row = table.rows[0]
    assert row.label == "a (3 runs; claims depth when scaled and shifted)"
    assert row.cells[0].rest.startswith(" ± 0.0020 [")
    floor = replace(
        several, meta=replace(several.meta, noise_floors={"chamfer": 0.0123}, confidence=0.9)
    )
    notes = leaderboard([floor, rooms("b")], paper=False)[0].notes
    assert "Noise floor of Chamfer at this resolution: 0.01230 scene units." in notes
    assert any(note.startswith("[low, high]: 90% and 95% interval") for note in notes)


def angles(shift):
    return {
        str(a): {"chamfer": Score(a / 100 + shift, None, None, "scene unit", 2, None)}
        for a in (5, 35, 0)
    }


def test_scores_by_view_angle_keep_the_order_of_the_ranking():
    files = [rooms("b", 0.3, by_view_angle=angles(0.0)), rooms("a", by_view_angle=angles(0.1))]
    _, table = leaderboard(files, paper=False)
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
    board = leaderboard([made[name] for name in files])
    shown = shown_figures(board)
    for figure in (figure for table in TABLES for figure in table.figures):
        assert figure.text in shown
    assert len(shown) >= sum(len(table.figures) for table in TABLES)
    assert all(row.cells[0].best for t in board for row in t.rows if row.rank == "1")
    if files:
        ranking = board[0]
        assert ranking.rows[0].kind == "ranked"
        assert ranking.rows[1].kind == "reported"
        assert any("as reported, on the authors' data, so not ranked" in n for n in ranking.notes)
        assert any("no unit of length" in n for n in ranking.notes) == (files[0] == "rooms")


def test_figures_of_other_scores_or_angles_do_not_slip_into_a_ranking():
    board = leaderboard([rooms("a", by_view_angle=angles(0.2))])
    ranking, turned = board[:2]
    assert len(by_label(ranking)) == 1 + 4
    assert by_label(ranking)["PTN, ShapeNet scenes (Table 1) †"].cells[0].value == "0.181"
    row = by_label(turned)["Pix2Shape, Shape scenes (Table 2) †"]
    assert [cell.value for cell in row.cells] == ["-", "0.098", "0.112"]
    alone = leaderboard([rooms("a")], paper=False)[0]
    assert [row.kind for row in alone.rows] == ["ranked"]
    people = leaderboard([iqtt_scores("a", [1])])[0]
    cell = by_label(people)["Human Evaluation, 3D-IQTT, 0 labels (Table 3) †"].cells[0]
    assert (cell.value, cell.rest) == ("0.7329", " ± 0.148")
