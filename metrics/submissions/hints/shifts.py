"""Hints on measured truth: predictions that lie half a pixel or more off, or show a crop of it."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from metrics.measured.protocols import NYU, crop_mask
from metrics.measured.reader import MeasuredFile
from metrics.submissions.hints.samples import FEWEST_PIXELS, ROWS
from metrics.submissions.problems import HINT, Problem
from metrics.submissions.reader import RoomPredictions
from metrics.submissions.rules import LARGEST

Array = NDArray[np.float64]
Places = Callable[[Array, Array, tuple[int, int]], tuple[Array, Array]]
BETTER = 0.5  # fraction of the error that may remain after a remedy
SHARE = 0.6  # fraction of the images in which it must
STEPS = (0.5, 1.0, 2.0)  # pixels


def shift_hints(predictions: RoomPredictions, truth: MeasuredFile) -> list[Problem]:
    """Return a hint where predictions fit far better when they are taken from another place.

    Each image may have a scale and a shift of its own. Noise of truth or prediction is left after
    any remedy, so that a right prediction never gets a hint. Raises FileFormatError.
    """
    spread = np.linspace(0, len(predictions) - 1, ROWS).astype(np.int64)
    ratios: dict[str, list[float]] = {name: [] for name in _REMEDIES}
    for i in np.unique(spread).tolist():
        row = int(predictions.rows[i])
        if not 0 <= row < len(truth):
            continue
        size = truth.size(row)
        values = predictions.geometry(i)[: size[0], : size[1]]
        values = -values[..., 2] if predictions.kind == "points" else values
        true = truth.view(row).depth.astype(np.float64)
        true = 1.0 / true if predictions.kind == "disparity" else true
        at = np.argwhere(np.isfinite(true)).astype(np.float64)
        at = at[:: max(1, len(at) // 20_000)]
        if len(at) < FEWEST_PIXELS:
            continue
        t = true[tuple(at.astype(int).T)]
        given = _error(_sampled(values, at[:, 0], at[:, 1]), t)
        for name, place in _REMEDIES.items():
            found = _sampled(values, *place(at[:, 0], at[:, 1], size))
            ratios[name].append(_error(found, t) / given if given > 0.0 else 1.0)
    counted = {name: np.array(one) for name, one in ratios.items() if one}
    good = {n: float(np.median(r)) for n, r in counted.items() if np.mean(r <= BETTER) >= SHARE}
    if not good:
        return []
    expected = "each value at the pixel that it is of"
    return [Problem(predictions.kind, HINT, expected, min(good, key=good.__getitem__))]


def _sampled(values: Array, rows: Array, columns: Array) -> Array:
    """Return values (N,) between pixels, by bilinear interpolation; the edge beyond it."""
    y = np.clip(rows, 0, len(values) - 1.0)
    x = np.clip(columns, 0, values.shape[1] - 1.0)
    i, j = (np.minimum(v.astype(int), n - 2) for v, n in ((y, len(values)), (x, values.shape[1])))
    i, j = np.maximum(i, 0), np.maximum(j, 0)
    k, m = np.minimum(i + 1, len(values) - 1), np.minimum(j + 1, values.shape[1] - 1)
    a, b = y - i, x - j
    top, low = values[i, j] * (1 - b) + values[i, m] * b, values[k, j] * (1 - b) + values[k, m] * b
    return np.asarray(top * (1 - a) + low * a)


def _error(p: Array, t: Array) -> float:
    """Return the mean absolute error after the line that fits p best, both (N,)."""
    usable = np.abs(p) <= LARGEST
    if np.count_nonzero(usable) < FEWEST_PIXELS:
        return np.inf
    p, t = p[usable], t[usable]
    centred = p - p.mean()
    square = float(centred @ centred)
    slope = max(float(centred @ t) / square, 0.0) if square > 0.0 else 0.0
    return float(np.abs(slope * centred + t.mean() - t).mean())


def _shifted(down: float, right: float) -> Places:
    return lambda rows, columns, size: (rows + down, columns + right)


def _crop(rows: Array, columns: Array, size: tuple[int, int]) -> tuple[Array, Array]:
    """Return where a prediction that shows the crop of NYU alone has what is at a pixel."""
    if size != NYU.size:
        return rows, columns
    inside = np.argwhere(crop_mask((NYU,), *size))
    first, tall = inside[0], np.ptp(inside, axis=0) + 1
    return tuple(
        (v + 0.5 - f) * n / t - 0.5
        for v, f, n, t in zip((rows, columns), first, size, tall, strict=True)
    )


_REMEDIES: dict[str, Places] = {
    f"looks shifted by {step * abs(y):g} pixels {'up' if y < 0 else 'down'} and"
    f" {step * abs(x):g} {'left' if x < 0 else 'right'}": _shifted(step * y, step * x)
    for step in STEPS
    for y in (-1, 0, 1)
    for x in (-1, 0, 1)
    if y or x
} | {"looks like the crop of NYU, rows 45 to 471 and columns 41 to 601, enlarged": _crop}
