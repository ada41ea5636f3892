"""Which score files may be compared, and where each of them has the same images or questions."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from metrics.measures.checks import LARGEST_MAGNITUDE
from metrics.scoring.aligned import again
from metrics.scoring.metric_names import EMPTY_ROOM, HEADLINE, OF_TRUTH, metric
from metrics.scoring.records import ID_COLUMNS, ScoreFile
from metrics.scoring.truth_digests import require_truth
from scenegen.common.errors import SceneGenError

Array = NDArray[np.float64]
IDS_SHOWN = 5
FLOOR_AGREEMENT = 1e-6  # relative: of the empty room, drawn on other machines
SCORE_AGAIN = "score the submissions again with this release"
CHANGED = "one of the files has been changed"


class ComparisonError(SceneGenError):
    """Scores that cannot be compared with each other."""


def require_same_test(
    files: Sequence[ScoreFile], metrics: Sequence[str] | None, allow_incomparable: bool
) -> tuple[str, ...]:
    """Return the names of the scores to compare, if the files are of one test set.

    Raises OtherTruthError where they are not, ComparisonError where one of them says that it is not
    comparable and that is not allowed, and UnknownMetricError.
    """
    if len(files) < 2:
        raise ComparisonError("comparison", f"{len(files)} score file", "two or more")
    first = files[0]
    for file in files:
        require_truth(file, first.truth, first.place, first.protocol)
        if not file.comparable and not allow_incomparable:
            why = "; ".join(file.warnings) or "see its warnings"
            raise ComparisonError(
                file.place,
                f"its scores are not comparable: {why}",
                hint="or use --allow-incomparable",
            )

    def shown() -> list[str]:  # a test set of single views, say, has nothing behind
        return [n for n in HEADLINE[first.kind] if all(n in file.headline for file in files)]

    names = tuple(dict.fromkeys(metrics or shown() or HEADLINE[first.kind]))
    for name in names:
        if first.task not in metric(name).tasks:
            raise ComparisonError("metric", name, f"a score of task {first.task!r}")
        if metric(name).signed:
            found = f"{name}, a bias, of which neither direction is better"
            raise ComparisonError("metric", found, "a metric with a better direction")
    older = [file for file in files if file.older]
    others = [name for name in names if metric(name).redefined]
    if 0 < len(older) < len(files) and others:
        found, hint = f"format 1.0, in which {', '.join(others)} are defined otherwise", SCORE_AGAIN
        raise ComparisonError(older[0].place, found, "files of one format", hint)
    return names


def common_rows(files: Sequence[ScoreFile]) -> list[NDArray[np.int64]]:
    """Return, for each file, the indices of its entries of the rows that all files have.

    The entries are in the order of their row numbers. Raises ComparisonError where comparable
    files hold different rows, or where files disagree about which scene a row belongs to.
    """
    first, what = files[0], ID_COLUMNS[files[0].task][0]
    common = np.sort(first.ids)
    for file in files[1:]:
        missing, extra = np.setdiff1d(first.ids, file.ids), np.setdiff1d(file.ids, first.ids)
        if (len(missing) or len(extra)) and file.comparable and first.comparable:
            which = f"without {_listed(missing)}" if len(missing) else f"with {_listed(extra)}"
            raise ComparisonError(
                file.place,
                f"{len(file.ids)} {what}s, {which}",
                f"the {len(first.ids)} of {first.place}",
            )
        common = np.intersect1d(common, file.ids)
    if not len(common):
        raise ComparisonError("comparison", f"no {what} that all files score", "at least one")
    orders = []
    for file in files:
        rising = np.argsort(file.ids)
        orders.append(rising[np.searchsorted(file.ids, common, sorter=rising)])
        wrong = file.clusters[orders[-1]] != first.clusters[orders[0]]
        if wrong.any():
            raise ComparisonError(
                file.place,
                f"{what} {common[wrong][0]} in another scene",
                f"that of {first.place}",
                CHANGED,
            )
    _require_same_floors(files, orders)
    return orders


def _require_same_floors(files: Sequence[ScoreFile], orders: Sequence[NDArray[np.int64]]) -> None:
    """Raise ComparisonError where files disagree about the empty room, which is the truth's."""
    first = files[0].items
    for file, order in zip(files[1:], orders[1:], strict=True):
        for name in [
            name
            for name in first
            if name.startswith(OF_TRUTH)
            and name in file.items
            and not (
                metric(name.removeprefix(EMPTY_ROOM)).redefined and file.older != files[0].older
            )
        ]:
            ours, theirs = first[name][orders[0]], file.items[name][order]
            same = np.isclose(theirs, ours, FLOOR_AGREEMENT, FLOOR_AGREEMENT**2, equal_nan=True)
            if not same.all():
                i = int(np.argmin(same))
                found = f"{float(theirs[i])!r} in row {file.ids[order][i]}"
                expected = f"{float(ours[i])!r} as in {files[0].place}"
                raise ComparisonError(f"{file.place}: items.{name}", found, expected, CHANGED)


def column(file: ScoreFile, name: str, order: NDArray[np.int64]) -> Array:
    """Return a score of the compared rows, (N,); NaN where a row has no such score.

    Raises ComparisonError where the file lacks it, or holds no usable number for one of the rows
    that every file has a score for.
    """
    where = f"{file.place}: items.{name}"
    if name not in file.items:
        held = ", ".join(n for n in file.items if n in file.metrics)
        hint = f"the file has {held}"
        if file.declared is not None:
            where, hint = f"{where} after {file.alignment}", again(file.alignment)
        raise ComparisonError(where, "none", "the scores of all items", hint)
    values: Array = file.items[name][order]
    lacking = np.isnan(values) if metric(name).lacking else np.zeros(len(values), bool)
    bad = ~(np.abs(values) <= LARGEST_MAGNITUDE) & ~lacking
    if bad.any():
        rows = file.ids[order][bad]
        raise ComparisonError(
            where,
            f"{len(rows)} of {len(values)} {ID_COLUMNS[file.task][0]}s without a usable number:"
            f" {_listed(rows)}",
            "finite numbers",
        )
    return values


def pair(
    file: ScoreFile, reference: ScoreFile, name: str, orders: tuple[NDArray[np.int64], ...]
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Return a score in both files, (M,) each, and which of the compared rows have it, (N,).

    Which rows those are follows from the truth. Raises ComparisonError where the files differ in
    that, or no row has it; else as `column`.
    """
    ours, theirs = column(file, name, orders[0]), column(reference, name, orders[1])
    there = ~np.isnan(theirs)
    differ = np.isnan(ours) == there
    where = f"{file.place}: items.{name}"
    if differ.any():
        rows = file.ids[orders[0]][differ]
        raise ComparisonError(
            where,
            f"other items without a value, such as {_listed(rows)}",
            f"those of {reference.place}",
            CHANGED,
        )
    if not there.any():
        raise ComparisonError(where, "no number at all", "a row that has this score")
    return ours[there], theirs[there], there


def _listed(ids: NDArray[np.int64]) -> str:
    return ", ".join(map(str, ids[:IDS_SHOWN])) + " ..." * (len(ids) > IDS_SHOWN)
