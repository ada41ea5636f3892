"""What stands where in a leaderboard, and what never ranks."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_scores import iqtt_scores, rooms_scores, stated
from refusals import refused

from baselines.trivial import write_room_baseline
from iqtt.floors import CHANCE, Floor
from metrics.score_file import Skill, read_scores, write_scores
from metrics.scoring.evaluate import score
from metrics.scoring.metric_names import UnknownMetricError
from metrics.views.leaderboard import FloorError, LeaderboardError, leaderboard, rankings

SCENES = [0, 0, 1, 1]


def rooms(name, chamfer=0.2, mse=0.02, **other):
    columns = {"chamfer": np.ones(4) * chamfer, "hausdorff": [0.5] * 4, "mse_depth": [mse] * 4}
    return rooms_scores(name, columns, SCENES, path=Path(f"{name}.json"), **other)


def ranks(table):
    return [(row.cells[0].value, row.cells[1].value) for row in table.rows]


def values(table):
    return {row.cells[1].value: [cell.value for cell in row.cells[2:]] for row in table.rows}


def rests(table):
    return {row.cells[1].value: [cell.rest for cell in row.cells[2:]] for row in table.rows}


def best(table):
    return [[cell.best for cell in row.cells[2:]] for row in table.rows]


def test_ranks_and_best_cells():
    files = [rooms("b", 0.3, 0.01), rooms("a", 0.1, 0.02), rooms("c", 0.3, 0.04)]
    (table,) = leaderboard(files, paper=False)
    assert ranks(table) == [("1", "a"), ("2", "b"), ("2", "c")]
    assert best(table) == [[True, False, False], [False, False, True], [False, False, False]]
    assert rests(table)["a"][0] == "[0.1000, 0.1000]"
    floors = (Floor("mirror", CHANCE, 1 / 3, 2500),)
    rights = {"low": [1, 0, 0] * 5, "high": [1, 1, 1] * 5}
    files = [iqtt_scores(name, right, question_floors=floors) for name, right in rights.items()]
    (table,) = leaderboard(files, paper=False)
    assert best(table) == [[True, True], [False, False], [False, False]]
    assert ranks(table) == [("1", "high"), ("", f"baseline: {CHANCE}"), ("", "low")]
    files = [iqtt_scores(name, right) for name, right in rights.items()]  # no baseline is known
    assert ranks(leaderboard(files, paper=False)[0]) == [
        ("1", "high"), ("", "baseline: chance"), ("", "low")
    ]  # fmt: skip


def test_what_is_not_comparable_is_never_ranked_nor_best():
    part = rooms("part", 0.001, 0.001, comparable=False)
    for files in ([part, rooms("a")], [rooms("a"), part]):
        (table,) = leaderboard(files, paper=False)
        assert ranks(table) == [("1", "a"), ("", "part ‡")]
        assert table.rows[1].kind == "incomparable"
        assert best(table) == [[False] * 3] * 2, "a method alone is better than none"
    assert best(leaderboard([part], paper=False)[0]) == [[False] * 3]


def test_test_sets_are_never_ranked_together():
    other = "f" * 64
    files = [rooms("a", 0.3), rooms("b", 0.1, truth=other, digest=other), rooms("c", 0.2)]
    first, second = leaderboard(files, paper=False)
    assert ranks(first) == [("1", "c"), ("2", "a")]
    assert ranks(second) == [("1", "b")]
    # One fingerprint, two tasks or other bits: still two test sets.
    for second in (iqtt_scores("b", [1]), rooms("b", digest="f" * 64)):
        tables = leaderboard([rooms("a"), second], paper=False)
        assert [len({row.cells[1].value for row in t.rows} & {"a", "b"}) for t in tables] == [1, 1]


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
    table = leaderboard([less, a], paper=False)[0]
    assert ranks(table) == [("1", "a"), ("", "b")]
    assert values(table)["b"][0] == "-"
    assert best(table) == [[False] * 3] * 2
    table = leaderboard([less, a], ["mse_depth", "normal_mean_degrees"], paper=False)[0]
    assert values(table)["b"] == ["0.02000", "-"]
    with pytest.raises(UnknownMetricError):
        leaderboard([a], ["cd"])


def skilled(name, chamfer=0.2, **other):
    """Rooms with a skill over a floor of 0.4."""
    columns = {"hausdorff": [0.3] * 4, "chamfer": [chamfer] * 4}
    skills = {"chamfer": Skill(1 - chamfer / 0.4, -0.5, 0.9, 0.4, "empty_room_chamfer")}
    told = {"skills": skills, "path": Path(f"{name}.json")}
    return rooms_scores(name, columns, SCENES, **{**told, **other})


def test_skill_stands_before_the_score_and_floors_below_the_methods():
    names = ["hausdorff", "chamfer"]
    table = leaderboard([skilled("worse", 0.3), skilled("better")], names, paper=False)[0]
    assert [row.kind for row in table.rows] == ["", "", "baseline"]
    # The first column is tied, the second decides.
    assert ranks(table)[:2] == [("1", "better"), ("1", "worse")]
    cells = values(table)
    assert cells["better"][2] == "0.5"
    assert cells["baseline: empty room"] == ["-", "0.4000", "0"]
    assert rests(table)["better"][2] == "[-0.5, 0.9]"
    assert best(table)[2:] == [[False] * 3]
    right = Skill(0.25, 0.1, 0.4, 0.5, "outline")
    table = leaderboard([iqtt_scores("q", [1, 0], skills={"iqtt_accuracy": right})])[0]
    assert values(table)["baseline: outline"] == ["0", "0.5000"]
    assert values(table)["baseline: chance"] == ["-", "0.3333"]


def test_methods_that_are_not_above_the_floor_have_no_rank_and_the_next_column_orders_them():
    columns = {"shape_error": [0.1] * 4, "relief_iou": [0.1] * 4}
    shapes = {"flat": (0.0, 0.0, 0.0), "tries": (-0.1, -0.2, 0.0), "knows": (0.3, 0.1, 0.5)}
    where = {"flat": 0.1, "tries": 0.6, "knows": 0.2}
    files = [
        rooms_scores(n, columns, SCENES, skills={
            "shape_error": Skill(*ends, 0.1, "cut_out_shape_error"),
            "relief_iou": Skill(where[n], None, None, 0.0, "other_scene_relief_iou"),
        })
        for n, ends in shapes.items()
    ]  # fmt: skip
    table = leaderboard(files, paper=False)[0]
    floor = "baseline: cut-out"
    assert ranks(table)[:4] == [("1", "knows"), ("", floor), ("", "tries"), ("", "flat")]
    (ranking,) = rankings(files[:2], paper=False)
    assert ranks(ranking.table)[:3] == [("", floor), ("", "tries"), ("", "flat")]


def test_a_test_set_has_one_floor():
    """Which every comparable file of it states; another one is forged, or of another release."""
    skill = Skill(0.9, 0.8, 1.0, 2.0, "empty_room_chamfer")
    where = "b.json: skills.chamfer.floor (empty_room_chamfer)"
    with refused(FloorError, where, "2.0", "0.4, as in a.json"):
        leaderboard([skilled("a"), skilled("b", skills={"chamfer": skill})])
    part = skilled("b", skills={"chamfer": skill}, comparable=False)
    assert leaderboard([part, skilled("a")])[0].rows[2].cells[-1].value != "2.000"


@pytest.mark.parametrize("other", [{}, {"method": "b", "path": Path("b.json")}])
def test_a_submission_stands_there_once(other):
    a = rooms("a")
    with refused(LeaderboardError, f"{other.get('path', a.path)}", "a.json", "once"):
        leaderboard([a, replace(a, **other)])


def varied(name, off, seed):
    """40 scenes of Chamfer distances about 0.2, with noise of their own."""
    noise = np.random.default_rng(seed).normal(0, 0.02, 40)
    return rooms_scores(name, {"chamfer": 0.2 + off + noise}, range(40), path=Path(f"{name}.json"))


def test_bold_needs_a_difference_that_its_interval_does_not_cross():
    files = [varied("a", 0.0, 1), varied("b", 0.004, 2), varied("c", 0.08, 3)]
    (table,) = leaderboard(files, paper=False)
    assert [row.cells[0].value for row in table.rows] == ["1", "1", "3"]
    assert best(table) == [[False]] * 3
    (table,) = leaderboard(files[::2], paper=False)
    assert best(table) == [[True], [False]]


def test_a_set_that_cannot_tell_methods_apart_says_so():
    nan = float("nan")
    one = [{"chamfer": [0.1 * k, *[nan] * 3], "hausdorff": [0.1] * 4} for k in (1, 2)]
    none = [{"chamfer": [0.1 * k] * 4, "object_depth_error": [nan] * 4} for k in (1, 2)]
    for columns in (one, none):
        files = [rooms_scores(n, c, range(4)) for n, c in zip("ab", columns, strict=True)]
        (ranking,) = rankings(files, ["chamfer"], paper=False)
        assert ranking.mute
        assert ranking.ranks == ("", "")
        assert best(ranking.table) == [[False]] * 2
    assert not rankings([rooms("a"), rooms("b")], paper=False)[0].mute


def test_the_papers_figures_of_the_shown_scores_are_marked_and_unranked():
    (ranking,) = leaderboard([rooms("a", 0.11)])
    reported = [row for row in ranking.rows if row.kind == "reported"]
    assert len(reported) == 4
    assert all(row.cells[1].value.endswith(" †") for row in reported)
    assert not any(row.cells[0].value or cell.best for row in reported for cell in row.cells)
    assert values(ranking)["PTN, ShapeNet scenes (Table 1) †"][0] == "0.181"
    other = {"other": iqtt_scores("a", [1]).by_distractor["mirror"]}
    (people,) = leaderboard([iqtt_scores("a", [1], by_distractor=other)])
    assert sum(row.kind == "reported" for row in people.rows) == 16
    # The questions are of mirror images, and the paper's are not.
    kinds = {row.kind for row in leaderboard([iqtt_scores("b", [1, 0])])[0].rows}
    assert kinds == {"", "baseline"}


def test_methods_that_see_the_first_view_alone_are_ranked_apart():
    columns = {name: [0.2] * 4 for name in ("shape_error", "behind_depth_error", "chamfer")}
    shown = {"a": "scored_view", "b": "first_view", "c": "no_view", "d": "first_view"}
    files = [replace(rooms_scores(n, columns, SCENES), shown=s) for n, s in shown.items()]
    looks, first, none = rankings(files, paper=False)
    methods = [[file.method for file in r.files] for r in (looks, first, none)]
    assert methods == [["a"], ["b", "d"], ["c"]]
    heads = [ranking.table.head[2:] for ranking in (looks, first, none)]
    assert [head[0].split()[0] for head in heads] == ["Shape", "Hidden", "Shape"]
    assert not any("behind" in column for column in heads[0])
    alone = [replace(file, columns={**file.columns, "view_index": 0 * file.ids}) for file in files]
    (together,) = rankings(alone, paper=False)
    assert len(together.files) == 4


def test_closed_rooms_are_in_metres_and_beside_no_figure_of_the_paper(interior_path, tmp_path):
    write_room_baseline("empty-room", interior_path, tmp_path / "x.h5")
    write_scores(score([tmp_path / "x.h5"], interior_path), tmp_path / "x.json")
    file = read_scores(tmp_path / "x.json")
    units = [file.metrics[name].unit for name in ("chamfer", "mse_depth", "relief_iou")]
    assert units == ["metre", "metre squared", "fraction"]
    tables = [leaderboard([replace(file, length=unit)]) for unit in ("metre", "scene unit")]
    plain = leaderboard([file], paper=False)
    assert [len(t[0].rows) > len(plain[0].rows) for t in tables] == [False, True]
