"""Files that do not belong together are refused, by an error that names them."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_scores import DIGEST, iqtt_scores, rooms_scores, stated
from refusals import refused

from metrics.scoring.metric_names import UnknownMetricError
from metrics.scoring.truth_digests import OtherTruthError
from metrics.views.compare.compare import compare
from metrics.views.compare.pairing import ComparisonError

SCENES = [0, 0, 1, 1, 2, 2]


def rooms(name, shift=0.0, **other):
    columns = {"chamfer": np.linspace(0.1, 0.2, len(SCENES)) + shift}
    return rooms_scores(name, columns, SCENES, path=Path(f"{name}.json"), **other)


def with_items(file, **columns):
    items = {name: np.asarray(column) for name, column in columns.items()}
    return replace(file, columns={**file.columns, **items})


def without(file, rows, comparable=False):
    """The same without some rows, marked as the scorer marks it."""
    kept = ~np.isin(file.ids, rows)
    columns = {name: column[..., kept] for name, column in file.columns.items()}
    return stated(replace(file, columns=columns), comparable=comparable)


A, B = rooms("a"), rooms("b")
FEWER = without(B, [1, 4], comparable=True)  # whole, by its own account
OTHER_ROWS = with_items(B, row=A.ids + 100)
OTHER_BITS = rooms("b", digest="f" * 64)
OTHER_SCENES = with_items(B, scene_index=[0, 0, 1, 2, 2, 2])
WITHOUT_ITEMS = replace(B, columns={k: v for k, v in B.columns.items() if k != "chamfer"})
NO_NUMBERS = [with_items(B, chamfer=[0.1, bad, 0.1, bad, 0.1, 0.1]) for bad in (np.nan, 1e200)]
UNUSABLE = "2 of 6 rows without a usable number: 1, 3"


@pytest.mark.parametrize("allowed", [False, True])
@pytest.mark.parametrize(
    ("files", "where", "found", "expected"),
    [
        (
            [A, OTHER_BITS],
            "",
            "rooms, ground truth with hash ffff",
            f"{DIGEST[:12]}, as a.json has",
        ),
        ([A, iqtt_scores("b", [1])], "", "iqtt", f"{DIGEST[:12]}, as a.json has"),
        ([], "comparison", "0 score file", "two or more"),
        ([A], "comparison", "1 score file", "two or more"),
        ([A, FEWER], "b.json", "4 rows, without 1, 4", "the 6 of a.json"),
        ([FEWER, A], "a.json", "6 rows, with 1, 4", "the 4 of b.json"),
        ([A, OTHER_ROWS], "b.json", "6 rows, without 0, 1, 2, 3, 4 ...", "the 6 of a.json"),
        ([A, OTHER_SCENES], "b.json", "row 3 in another scene", "that of a.json"),
        ([A, WITHOUT_ITEMS], "b.json: items.chamfer", "none", "the scores of all items"),
        *(([A, b], "b.json: items.chamfer", UNUSABLE, "finite numbers") for b in NO_NUMBERS),
    ],
)
def test_files_that_do_not_belong_together(files, where, found, expected, allowed):
    with refused((ComparisonError, OtherTruthError), where, found, expected):
        compare(files, ["chamfer"], allow_incomparable=allowed)


def test_scores_of_an_older_format_compare_where_their_definition_is_the_same():
    older = replace(with_items(B, mse_depth=np.ones((1, 6))), older=True)
    newer = with_items(A, mse_depth=np.zeros((1, 6)))
    with refused(ComparisonError, "b.json", "chamfer", hint="score"):
        compare([newer, older], ["mse_depth", "chamfer"])
    assert compare([newer, older], ["mse_depth"])
    assert compare([replace(A, older=True), older], ["chamfer"])


def test_files_that_are_not_comparable_need_leave():
    part = without(rooms("b", shift=0.1), [0, 1])
    for files in ([A, part], [part, A]):
        with refused(ComparisonError, "b.json", "only 4 of 6 images", hint="--allow-incomparable"):
            compare(files, ["chamfer"])
        found = compare(files, ["chamfer"], allow_incomparable=True)
        assert (found.items, found.clusters, found.comparable) == (4, 2, False)
        assert abs(found.differences[0].difference) == pytest.approx(0.1)
    with refused(ComparisonError, "comparison"):
        compare([part, without(A, [2, 3, 4, 5])], ["chamfer"], allow_incomparable=True)
    with refused(ComparisonError, "metric", found="iqtt_accuracy"):
        compare([A, A], ["iqtt_accuracy"])
    with pytest.raises(UnknownMetricError):
        compare([A, A], ["cd"])


NAN = float("nan")


@pytest.mark.parametrize(
    ("name", "column", "found"),
    [
        ("relief_iou", [0.1, 0.2, NAN, NAN, NAN, 0.3], "other items without a value, such as 4"),
        ("relief_iou", [0.1, 0.2, NAN, 0.3, 0.1, 0.3], "other items without a value, such as 3"),
        ("empty_room_chamfer", [0.1, 0.2, 0.3, 0.2, 0.1, 0.3001], "0.3001"),
    ],
)
def test_files_that_disagree_about_the_truth(name, column, found):
    """Which rows show objects, and how well an empty room does, is the same for every method."""
    relief = [0.1, 0.2, NAN, NAN, 0.1, 0.3]
    held = {"relief_iou": relief, "empty_room_chamfer": [0.1, 0.2, 0.3, 0.2, 0.1, 0.3]}
    first, second = with_items(A, **held), with_items(B, **{**held, name: column})
    with refused(ComparisonError, f"b.json: items.{name}", found, hint="one of the files"):
        compare([first, second], ["relief_iou"])
    none = [with_items(one, relief_iou=[NAN] * 6) for one in (A, B)]
    with refused(ComparisonError, "b.json: items.relief_iou", "no number at all"):
        compare(none, ["relief_iou"])
