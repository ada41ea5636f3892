"""Files that do not belong together are refused, in a line that names them."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_scores import iqtt_scores, rooms_scores

from metrics.comparison.compare import ComparisonError, compare
from metrics.scoring.metric_names import UnknownMetricError

SCENES = [0, 0, 1, 1, 2, 2]


def rooms(name, shift=0.0, **other):
    columns = {"chamfer": np.linspace(0.1, 0.2, len(SCENES)) + shift}
    return rooms_scores(name, columns, SCENES, path=Path(f"{name}.json"), **other)


def without(file, rows):
    """The same without some rows, stamped as the scorer stamps it."""
    kept = ~np.isin(file.ids, rows)
    items = {name: column[kept] for name, column in file.items.items()}
    return replace(file, items=items, comparable=False)


def refusal(files, **options):
    with pytest.raises(ComparisonError) as caught:
        compare(files, ["chamfer"], **options)
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize("allowed", [False, True])
def test_other_truths_tasks_and_rows(allowed):
    a = rooms("a")
    line = refusal([a, rooms("b", truth="f" * 64)], allow_incomparable=allowed)
    assert line == (
        "b.json: found scores of truth ffffffffffff, expected 0123456789ab as in a.json:"
        " only scores of one test set compare"
    )
    assert "task iqtt, expected rooms" in refusal(
        [a, iqtt_scores("b", [1, 0])], allow_incomparable=allowed
    )
    # Whole, by its own account, and still of other rows.
    fewer = replace(without(rooms("b"), [1, 4]), comparable=True)
    line = refusal([a, fewer], allow_incomparable=allowed)
    assert line == "b.json: found 4 rows, expected the 6 of a.json: without 1, 4"
    assert refusal([fewer, a], allow_incomparable=allowed).endswith("of b.json: with 1, 4")
    moved = replace(a, items={**a.items, "row": a.ids + 100}, path=Path("c.json"))
    assert "without 0, 1, 2, 3, 4 ..." in refusal([a, moved], allow_incomparable=allowed)
    scenes = np.array([0, 0, 1, 2, 2, 2])
    other = replace(a, items={**a.items, "scene_index": scenes}, path=Path("c.json"))
    line = refusal([a, other], allow_incomparable=allowed)
    assert line.startswith("c.json: found row 3 in another scene than in a.json")


def test_files_that_are_not_comparable_need_leave():
    a, part = rooms("a"), without(rooms("b", shift=0.1), [0, 1])
    part = replace(part, meta=replace(part.meta, warnings=("2 rows are missing",)))
    for files in ([a, part], [part, a]):
        line = refusal(files)
        assert line.startswith("b.json: says that it is not comparable (2 rows are missing); ")
        assert "--allow-incomparable" in line
        found = compare(files, ["chamfer"], allow_incomparable=True)
        assert (found.items, found.clusters, found.comparable) == (4, 2, False)
        assert abs(found.differences[0].difference) == pytest.approx(0.1)
        assert found.differences[0].ties == 0
        assert "b says that it is not comparable: 2 rows are missing" in found.notes
        assert "compared over the 4 rows that all of the files score" in found.notes
    rest = without(a, [2, 3, 4, 5])
    assert "there is no row that all of the files score" in refusal(
        [part, rest], allow_incomparable=True
    )


def test_scores_that_are_missing_or_no_numbers():
    a = rooms("a")
    line = refusal([a, replace(a, items={k: v for k, v in a.items.items() if k != "chamfer"})])
    assert line.startswith("a.json: found no items.chamfer, expected one; it has")
    for bad in (np.nan, 1e200):
        column = a.items["chamfer"].copy()
        column[[1, 3]] = bad
        line = refusal([a, replace(a, items={**a.items, "chamfer": column}, path=Path("b.json"))])
        assert line == "b.json: items.chamfer holds no usable number for 2 of 6 rows: 1, 3"


def test_a_single_file_and_other_scores():
    a = rooms("a")
    for files in ([], [a]):
        with pytest.raises(ComparisonError, match=f"found {len(files)} score file.*two or more"):
            compare(files)
    with pytest.raises(ComparisonError, match="iqtt_accuracy is no score of task 'rooms'"):
        compare([a, a], ["iqtt_accuracy"])
    with pytest.raises(UnknownMetricError, match="'cd' is no score"):
        compare([a, a], ["cd"])
