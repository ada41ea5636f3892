"""Hints on rows in another order than the truth's, so that predictions fit other rows."""

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
TRUTHS = 4096  # rows of the truth among which the right one is searched
PREDICTIONS = 64  # rows of the submission that are searched for
SIDE = 8  # pixels per side by which rows are compared, at most twice as many
# Measured: of good predictions for other rooms 3 to 16% are so clear, among 8 to 4000 rows.
CLEAR = 0.7  # largest error of the best row, as a fraction of the second best one's
FIT = 0.5  # largest error of the best row, as a fraction of what a constant would score
SHARE = 0.5  # fraction of the predictions that must fit other rows
FEWEST = 4  # rows without which there is no hint


def order_hints(predictions: RoomPredictions, truth: RoomsFile) -> list[Problem]:
    """Return a hint where most predictions clearly fit another row, each a different one."""
    if predictions.kind == "disparity":  # whose scale and shift differ from image to image
        return []
    rows = predictions.rows
    entries = np.flatnonzero((rows >= 0) & (rows < len(truth)))
    candidates = np.unique(rows[entries])[:TRUTHS]
    if len(candidates) < FEWEST:
        return []
    size = (truth.spec.height, truth.spec.width)
    grid = np.ix_(mirrored_grid(size[0], SIDE), mirrored_grid(size[1], SIDE))
    true = np.stack([_pixels(truth.read("depth", int(row)), grid) for row in candidates])
    among = entries[np.isin(rows[entries], candidates)]
    spread = np.linspace(0, len(among) - 1, PREDICTIONS).astype(np.int64)
    predicted = {}
    for entry in among[np.unique(spread)].tolist():
        with suppress(FileFormatError):
            predicted[entry] = _pixels(predictions.depth(entry), grid)
    place_of = {entry: int(np.searchsorted(candidates, rows[entry])) for entry in predicted}
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # images without a finite pixel have no error
        scale = np.nanmedian([p / true[place_of[entry]] for entry, p in predicted.items()])
        fits = [(e, _other_row(p / scale, true, place_of[e])) for e, p in predicted.items()]
    others = {int(rows[e]): int(candidates[place]) for e, place in fits if place is not None}
    if len(set(others.values())) < max(3.0, SHARE * len(predicted)):
        return []
    listed = ", ".join(f"that of row {a} fits row {b}" for a, b in list(others.items())[:3])
    found = f"rows look shuffled: {len(others)} of {len(predicted)} predictions; {listed}"
    return [Problem("row", HINT, "each prediction with its own row", found, first_ids(others))]


def _other_row(predicted: Array, true: Array, place: int) -> int | None:
    """Return which of the images (N, P) a prediction (P,) clearly shows, unless that at `place`."""
    errors = np.nanmean(np.abs(true - predicted), axis=1)
    if not np.isfinite(errors).all():
        return None
    best, second = np.argsort(errors)[:2].tolist()
    spread = float(np.nanmean(np.abs(true[best] - np.nanmedian(true[best]))))
    most = min(CLEAR * errors[second], FIT * spread)
    return best if best != place and errors[best] <= most else None


def _pixels(depth: Array, grid: tuple[Array, ...]) -> Array:
    return np.asarray(depth[grid], dtype=np.float64).ravel()
