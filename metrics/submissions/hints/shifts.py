"""Hints on measured truth: predictions that lie half a pixel or more off, or show a crop of it."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from metrics.measured.protocols import NYU, crop_mask
from metrics.measured.reader import MeasuredFile
from metrics.measures.alignment import align
from metrics.submissions.hints.samples import FEWEST_PIXELS, ROWS
from metrics.submissions.problems import HINT, Problem
from metrics.submissions.reader import RoomPredictions
from metrics.submissions.rules import LARGEST

Array = NDArray[np.float64]
Places = NDArray[np.int64]  # rows and columns, (N, 2)
MOST_PIXELS = 20_000  # of an image
REACH = 2  # pixels over which edges are looked for, and by which a shift is told
EDGE = 0.1  # of a depth, by which it differs REACH pixels to both sides
FEWEST = 3  # images with edges
LEAST = 0.3  # pixels of a shift
CERTAIN = 4.0  # standard errors of it
SHARE = 0.6  # fraction of the images that must show it
BETTER = 0.5  # fraction of the error that may remain after the crop is undone
SIDES = (("up", "down"), ("left", "right"))


def shift_hints(predictions: RoomPredictions, truth: MeasuredFile) -> list[Problem]:
    """Return a hint where predictions lie beside the truth, or show the crop of NYU alone.

    Each image may have a scale and a shift of its own in depth. Raises FileFormatError.
    """
    spread = np.linspace(0, len(predictions) - 1, ROWS).astype(np.int64)
    edges, cropped = list[Array](), list[bool]()
    for i in np.unique(spread).tolist():
        row = int(predictions.rows[i])
        if not 0 <= row < len(truth):
            continue
        size = truth.size(row)
        values = predictions.geometry(i)[: size[0], : size[1]]
        values = -values[..., 2] if predictions.kind == "points" else values
        true = truth.view(row).depth.astype(np.float64)
        true = 1.0 / true if predictions.kind == "disparity" else true
        at = np.argwhere(np.isfinite(true) & (np.abs(values) <= LARGEST))
        at = at[:: max(1, len(at) // MOST_PIXELS)]
        if len(at) >= FEWEST_PIXELS:
            t = true[tuple(at.T)]
            edges.append(_edges(values, at, t))
            cropped.append(size == NYU.size and _is_crop(values, at, t))
    expected = "each value at the pixel that it is of"
    found = _shift(edges)
    if len(cropped) and np.mean(cropped) >= SHARE:
        found = "looks like the crop of NYU, rows 45 to 471 and columns 41 to 601, enlarged"
    return [Problem(predictions.kind, HINT, expected, found)] if found else []


def _edges(values: Array, at: Places, t: Array) -> Array:
    """Return by how many pixels edges of both axes and signs lie off, and the weights, (2, 2, 2).

    Where a prediction p shows what lies d further, and has slope g, p is t + d g, as in optical
    flow (Lucas & Kanade 1981). Least squares of relative errors find t = a + b p - b d g, with a d
    for each axis and sign of steep slopes. The slope does not use the pixel itself, so that noise
    biases nothing. Weights are inverse variances; 0 where there are too few edges.
    """
    size = np.array(values.shape)
    inside = ((at >= REACH) & (at < size - REACH)).all(axis=1)
    at, t = at[inside], t[inside]
    p = values[tuple(at.T)]
    columns = [np.ones_like(p), p]
    for axis in (0, 1):
        step = np.eye(2, dtype=np.int64)[axis] * REACH
        ends = (values[tuple((at + sign * step).T)] for sign in (1, -1))
        on, off = (np.where(np.abs(end) <= LARGEST, end, np.nan) for end in ends)
        apart = np.nan_to_num(on - off)
        steep = np.abs(apart) > EDGE * np.abs(p)
        columns += [np.where(steep & (apart * sign > 0), apart, 0.0) for sign in (1, -1)]
    known = np.sum(np.array(columns[2:]) != 0.0, axis=1) >= FEWEST_PIXELS
    table = np.stack(columns, axis=1) / np.abs(t)[:, None]
    square = np.linalg.pinv(table.T @ table)
    found = square @ (table.T @ np.sign(t))
    rest = table @ found - np.sign(t)
    noise = float(rest @ rest) / max(len(t) - len(found), 1)
    if not found[1] > 0.0 or not noise > 0.0:
        return np.zeros((2, 2, 2))
    scale = -2 * REACH / found[1]
    variance = np.diag(square)[2:] * noise * scale**2
    weights = np.divide(1.0, variance, out=np.zeros(4), where=known & (variance > 0.0))
    return np.stack([found[2:] * scale, weights], axis=-1).reshape(2, 2, 2)


def _shift(edges: Sequence[Array]) -> str:
    """Return what a shift looks like that edges of both signs show alike; or nothing.

    Where a prediction is too near at its edges, blurred, or too far on the floor, edges of the two
    signs seem to be shifted against each other.
    """
    sides = []
    for axis in (0, 1):
        images = np.array([one[axis] for one in edges if (one[axis, :, 1] > 0.0).all()])
        if len(images) < FEWEST:
            continue
        each, weights = images[..., 0], images[..., 1]
        apart = (each * weights).sum(axis=0) / weights.sum(axis=0)
        low, high = np.abs(apart).min(), np.abs(apart).max()
        shown = np.mean((np.sign(each) == np.sign(apart)).all(axis=1)) >= SHARE
        certain = (np.abs(apart) * np.sqrt(weights.sum(axis=0)) >= CERTAIN).all()
        if apart.prod() > 0.0 and high < 2 * low and low >= LEAST and shown and certain:
            pixels = max(np.round(2 * np.abs(apart).mean()) / 2, 0.5)
            side = SIDES[axis][int(apart.mean() < 0.0)]
            sides.append(f"{pixels:g} pixel{'s' if pixels > 1 else ''} {side}")
    return f"looks shifted by about {' and '.join(sides)}" if sides else ""


def _is_crop(values: Array, at: Places, t: Array) -> bool:
    """Return whether a prediction fits far better as an enlarged crop of NYU."""
    inside = np.argwhere(crop_mask((NYU,), *values.shape))
    low, tall = inside[0], np.ptp(inside, axis=0) + 1
    within = ((at >= low) & (at < low + tall)).all(axis=1)
    at, t = at[within], t[within]
    if len(at) < FEWEST_PIXELS:
        return False
    there = ((at + 0.5 - low) * values.shape / tall).astype(np.int64)
    predicted = (values[tuple(place.T)] for place in (there, at))
    usable = (np.where(np.abs(p) <= LARGEST, p, 0.0) for p in predicted)
    mended, given = (np.abs(align(p, t, "scale_shift") - t).mean() for p in usable)
    return bool(mended <= BETTER * given)
