"""Score files that may be compared, and their entries for the same images or questions."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from metrics.measures.checks import LARGEST_MAGNITUDE
from metrics.scoring.metric_names import HEADLINE, metric
from metrics.scoring.records import ID_COLUMNS, ScoreFile
from scenegen.common.errors import SceneGenError
from scenegen.common.text_table import plain

Array = NDArray[np.float64]
IDS_SHOWN = 5


class ComparisonError(SceneGenError):
    """Scores that cannot be compared with each other."""


def require_same_test(
    files: Sequence[ScoreFile], metrics: Sequence[str] | None, allow_incomparable: bool
) -> tuple[str, ...]:
    """The metrics' names, if the files are of one test set and may be compared."""
    if len(files) < 2:
        raise ComparisonError(f"found {len(files)} score file, expected two or more to compare")
    first = files[0]
    for file in files:
        _require_same("task", file, file.task, first, first.task)
        truths = (f.meta.truth_fingerprint for f in (file, first))
        _require_same("truth", file, next(truths), first, next(truths))
        if not file.comparable and not allow_incomparable:
            why = f" ({plain(file.meta.warnings[0])})" if file.meta.warnings else ""
            raise ComparisonError(
                f"{file.place}: says that it is not comparable{why}; score all rows without"
                " penalties, or say --allow-incomparable"
            )
    names = tuple(dict.fromkeys(metrics or HEADLINE[first.task]))
    for name in names:
        if metric(name).task != first.task:
            raise ComparisonError(f"{name} is no score of task {first.task!r}")
    return names


def _require_same(what: str, file: ScoreFile, found: str, first: ScoreFile, expected: str) -> None:
    if found != expected:
        raise ComparisonError(
            f"{file.place}: found scores of {what} {plain(found)[:12]}, expected"
            f" {plain(expected)[:12]} as in {first.place}: only scores of one test set compare"
        )


def common_rows(files: Sequence[ScoreFile]) -> list[NDArray[np.int64]]:
    """For each file, where its entries of the rows common to all lie, by rising row.

    Raises ComparisonError where comparable files hold different rows, or any disagree about scenes.
    """
    first, what = files[0], ID_COLUMNS[files[0].task][0]
    common = np.sort(first.ids)
    for file in files[1:]:
        missing, extra = np.setdiff1d(first.ids, file.ids), np.setdiff1d(file.ids, first.ids)
        if (len(missing) or len(extra)) and file.comparable and first.comparable:
            which = missing if len(missing) else extra
            raise ComparisonError(
                f"{file.place}: found {len(file.ids)} {what}s, expected the {len(first.ids)} of"
                f" {first.place}: {'without' if len(missing) else 'with'}"
                f" {', '.join(map(str, which[:IDS_SHOWN]))}{' ...' * (len(which) > IDS_SHOWN)}"
            )
        common = np.intersect1d(common, file.ids)
    if not len(common):
        raise ComparisonError(f"there is no {what} that all of the files score")
    orders = []
    for file in files:
        rising = np.argsort(file.ids)
        orders.append(rising[np.searchsorted(file.ids, common, sorter=rising)])
        wrong = file.clusters[orders[-1]] != first.clusters[orders[0]]
        if wrong.any():
            raise ComparisonError(
                f"{file.place}: found {what} {common[wrong][0]} in another scene than in"
                f" {first.place}: one of them was changed"
            )
    return orders


def column(file: ScoreFile, name: str, order: NDArray[np.int64]) -> Array:
    """A score of the compared rows."""
    if name not in file.items:
        held = ", ".join(n for n in file.items if n in file.metrics)
        raise ComparisonError(f"{file.place}: found no items.{name}, expected one; it has {held}")
    values: Array = file.items[name][order]
    bad = ~(np.abs(values) <= LARGEST_MAGNITUDE)
    if bad.any():
        rows = file.ids[order][bad]
        raise ComparisonError(
            f"{file.place}: items.{name} holds no usable number for {len(rows)} of {len(values)}"
            f" {ID_COLUMNS[file.task][0]}s: {', '.join(map(str, rows[:IDS_SHOWN]))}"
            f"{' ...' * (len(rows) > IDS_SHOWN)}"
        )
    return values
