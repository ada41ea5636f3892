"""Rows in another order than the truth's: each prediction fits another row than its own."""

import warnings
from contextlib import suppress
from typing import Any

import numpy as np
from numpy.typing import NDArray

from metrics.submissions.hints.samples import mirrored_grid
from metrics.submissions.problems import HINT, Problem, first_ids
from metrics.submissions.reader import RoomPredictions
from scenegen.common.errors import FileFormatError
from scenegen.rooms.reader import RoomsFile

Array = NDArray[Any]
TRUTHS = 4096  # rows of the truth among which the right one is sought
PREDICTIONS = 64
SIDE = 8  # pixels of each side by which rows are compared, at most twice as many
# Measured: of good predictions for other rooms 3 to 16% are so clear, among 8 to 4000 rows.
CLEAR = 0.7  # the part of the second best row's error to which the best one's must fall
FIT = 0.5  # the part of what a constant would score to which the best row's error must fall
SHARE = 0.5  # of the predictions
FEWEST = 4  # rows


def order_hints(predictions: RoomPredictions, truth: RoomsFile) -> list[Problem]:
    """Say whether most predictions clearly fit another row of the truth, each its own one."""
    rows = predictions.rows
    entries = np.flatnonzero((rows >= 0) & (rows < len(truth)))
    candidates = np.unique(rows[entries])[:TRUTHS]
    if len(candidates) < FEWEST:
        return []
    size = (truth.spec.height, truth.spec.width)
    grid = np.ix_(mirrored_grid(size[0], SIDE), mirrored_grid(size[1], SIDE))
    known = np.stack([_pixels(truth.read("depth", int(row)), grid) for row in candidates])
    among = entries[np.isin(rows[entries], candidates)]
    spread = np.linspace(0, len(among) - 1, PREDICTIONS).astype(np.int64)
    predicted = {}
    for entry in among[np.unique(spread)].tolist():
        with suppress(FileFormatError):
            predicted[entry] = _pixels(predictions.depth(entry), grid)
    own = {entry: int(np.searchsorted(candidates, rows[entry])) for entry in predicted}
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # images without a finite pixel have no error
        scale = np.nanmedian([p / known[own[entry]] for entry, p in predicted.items()])
        fits = [(e, _other_row(p / scale, known, own[e])) for e, p in predicted.items()]
    others = {int(rows[e]): int(candidates[place]) for e, place in fits if place is not None}
    if len(set(others.values())) < max(3.0, SHARE * len(predicted)):
        return []
    told = ", ".join(f"that of row {a} fits row {b}" for a, b in list(others.items())[:3])
    got = f"rows look shuffled: {len(others)} of {len(predicted)} predictions; {told}"
    return [Problem("row", HINT, "each prediction with its own row", got, first_ids(others))]


def _other_row(predicted: Array, known: Array, own: int) -> int | None:
    """Which of the known images (N, P) a prediction (P,) clearly shows, if it is not its own."""
    errors = np.nanmean(np.abs(known - predicted), axis=1)
    if not np.isfinite(errors).all():
        return None
    best, second = np.argsort(errors)[:2].tolist()
    spread = float(np.nanmean(np.abs(known[best] - np.nanmedian(known[best]))))
    most = min(CLEAR * errors[second], FIT * spread)
    return best if best != own and errors[best] <= most else None


def _pixels(depth: Array, grid: tuple[Array, ...]) -> Array:
    return np.asarray(depth[grid], dtype=np.float64).ravel()
