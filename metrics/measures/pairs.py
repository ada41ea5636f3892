"""Scores of pairs of pixels: which is nearer, and by which angle their surfaces are turned.

Depth that is right on average may still be bumpy. `relative_normal_degrees` sees it: two pixels of
one surface have two normals, and the angle between them is the same in any camera frame and at any
scale. `ordinal_accuracy` asks only which of two pixels is nearer.

Which pairs are compared follows from the row of the truth alone, so that all methods are asked the
same. They are points of Roberts' additive sequence, which fills space evenly.

Sources: Wu et al. 2025 (arXiv 2510.19814) for relative normals, their triangles, scales and radius,
and for SAWA-H; there the pairs are random, and may lie on different surfaces. Zoran et al. 2015 and
Chen et al. 2016 for ordinal pairs and the ratio.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
Mask = NDArray[np.bool_]

SCALES = (1, 2, 4, 8)  # pixels of an image per sample, along each side
RADIUS, LEAST_RADIUS = 32, 3  # a pair is at most so far apart along each axis: pixels, samples
PAIRS = 8192  # of each scale, before those beyond the border are left out
ORDERED = 16384  # of the image, and again within objects
RATIO = 1.02  # by which the true depths of an ordered pair differ at least
EDGE = 1.05  # ratio of depths across which, without ids, another surface begins
STOPS = 24  # places between two pixels where an edge is looked for
DEGENERATE = 1e-5  # length of the cross product of a triangle's sides below which it has no normal


class Triangles(NamedTuple):
    """Pairs of triangles of one scale.

    Attributes:
        corners: pixels of the flat image, (P, 2, 3).
        angle: between the true normals, radians, (P,).
        same: whether both lie on one surface, (P,).
    """

    corners: Array
    angle: Array
    same: Mask


@dataclass(frozen=True)
class Order:
    """Pairs of pixels and their true order.

    Attributes:
        pixels: of the flat image, (P, 2).
        nearer: whether the first one is truly nearer, (P,).
        apart: whether the depths differ by RATIO at least, (P,).
        within, between: whether both are on one object, or one of them is and the other is not, or
            on another one, (P,).
    """

    pixels: Array
    nearer: Mask
    apart: Mask
    within: Mask
    between: Mask


def spread(count: int, axes: int, row: int) -> Array:
    """Return points (count, axes) of the unit cube, the same for a row on every machine."""
    root = 1.5
    for _ in range(64):  # of x^(axes + 1) = x + 1
        root = (1.0 + root) ** (1.0 / (axes + 1))
    steps = root ** -np.arange(1.0, axes + 1)
    return np.asarray((0.5 + (row * count + np.arange(count))[:, None] * steps) % 1.0)


def triangle_pairs(
    points: Array, mask: Mask, row: int, object_id: Array | None = None
) -> list[Triangles]:
    """Return the pairs of a true image for each of SCALES that has any.

    Args:
        points: true ones, camera frame, (H, W, 3).
        mask: the scored pixels, (H, W).
        row: of the truth.
        object_id: (H, W), 0 is the room; both triangles then lie on one object. None where nobody
            knows: then no depth edge lies between them.
    """
    flat = points.reshape(-1, 3)
    return [
        found
        for scale in SCALES
        if (found := _pairs_of_scale(flat, mask, row, object_id, scale)) is not None
    ]


def _pairs_of_scale(
    flat: Array, mask: Mask, row: int, object_id: Array | None, scale: int
) -> Triangles | None:
    samples, valid = _sampled(mask, scale)
    height, width = (side - 2 for side in samples.shape)
    if height < 1 or width < 1:
        return None
    radius = min(max(RADIUS // scale, LEAST_RADIUS), max(height, width))
    u = spread(PAIRS, 4, row)
    first = np.floor(u[:, :2] * (height, width)).astype(np.int64)
    second = np.floor(u[:, :2] * (height, width) + (u[:, 2:] * 2.0 - 1.0) * radius).astype(np.int64)
    there = ((second >= 0) & (second < (height, width))).all(axis=1)
    ends = np.stack([first, second], axis=1)[there]  # (P, 2, 2)
    there = _corners(valid, ends).all(axis=(1, 2))
    ends = ends[there]
    corners = _corners(samples, ends)
    normals, proper = _normals(flat[corners])
    good = proper.all(axis=1)
    ends, corners, angle = ends[good], corners[good], _angle(normals[good])
    if object_id is not None:
        ids = object_id.reshape(-1)[corners].reshape(-1, 6)
        same = (ids > 0).all(axis=1) & (ids == ids[:, :1]).all(axis=1)
    else:
        same = _nothing_between(-flat[samples, 2], valid, ends)
    return Triangles(corners, angle, same) if len(angle) else None


def _sampled(mask: Mask, scale: int) -> tuple[Array, Mask]:
    """Return the pixel that stands for each square of pixels, flat, and whether it is scored.

    It is the scored one nearest to the middle of the square.
    """
    height, width = mask.shape
    tall, wide = -(-height // scale), -(-width // scale)
    padded = np.zeros((tall * scale, wide * scale), np.bool_)
    padded[:height, :width] = mask
    at = np.arange(scale) - (scale - 1) / 2.0
    order = np.argsort(np.hypot(at[:, None], at).ravel(), kind="stable")
    squares = padded.reshape(tall, scale, wide, scale).swapaxes(1, 2).reshape(tall, wide, -1)
    chosen = order[squares[..., order].argmax(axis=-1)]
    rows = np.arange(tall)[:, None] * scale + chosen // scale
    columns = np.arange(wide) * scale + chosen % scale
    valid = np.asarray(squares.any(axis=-1))
    return np.where(valid, rows * width + columns, 0), valid


def _corners(image: Array, at: Array) -> Array:
    """Return the values (..., 3) of the corners of triangles at (..., 2): two pixels wide."""
    i, j = at[..., 0], at[..., 1]
    return np.stack([image[i, j], image[i + 2, j], image[i, j + 2]], axis=-1)


def _normals(corners: Array) -> tuple[Array, Mask]:
    """Return unit normals (..., 3) of triangles (..., 3, 3), and where there is one (...)."""
    sides = corners[..., 1:, :] - corners[..., :1, :]
    length = np.sqrt(np.square(sides).sum(axis=-1, keepdims=True))
    down, along = np.moveaxis(sides / np.maximum(length, np.finfo(float).tiny), -2, 0)
    normal = np.cross(down, along)
    size = np.sqrt(np.square(normal).sum(axis=-1))
    return normal / np.maximum(size, DEGENERATE)[..., None], size > DEGENERATE


def _angle(normals: Array) -> Array:
    """Return the angle, radians, between the two normals of pairs (P, 2, 3)."""
    first, second = normals[:, 0], normals[:, 1]
    sine = np.sqrt(np.square(np.cross(first, second)).sum(axis=-1))
    return np.asarray(np.arctan2(sine, (first * second).sum(axis=-1)))


def _nothing_between(depth: Array, valid: Mask, ends: Array) -> Mask:
    """Return for pairs (P, 2, 2) of samples whether no edge of depth (H, W) lies between them."""
    height, width = depth.shape
    i, j = np.mgrid[: height - 2, : width - 2]
    three = _corners(np.where(valid, depth, np.nan), np.stack([i, j], axis=-1))
    near, far = three.min(axis=-1), three.max(axis=-1)
    smooth = far <= EDGE * near  # False where a corner is not scored
    t = np.linspace(0.0, 1.0, STOPS)[:, None, None]
    way = np.rint(ends[:, 0] * (1.0 - t) + ends[:, 1] * t).astype(np.int64)
    return np.asarray(smooth[way[..., 0], way[..., 1]].all(axis=0))


def relative_normal_scores(points: Array, pairs: Sequence[Triangles]) -> dict[str, float]:
    """Return `relative_normal_degrees`, that over all pairs in radians, and that of flat surfaces.

    The first is the mean absolute difference of predicted and true angle between the normals of
    pairs on one surface, the mean over the scales; a pair without a predicted normal counts as 180
    degrees; NaN without pairs. `anywhere` is that of all pairs, radians, as it was published, 0
    without any. `flat` is `relative_normal_degrees` of surfaces that are planes.

    Args:
        points: predicted, camera frame, (H, W, 3); finite where the truth is scored.
    """
    flat, errors = points.reshape(-1, 3), []
    for scale in pairs:
        normals, proper = _normals(flat[scale.corners])
        error = np.where(proper.all(axis=1), np.abs(_angle(normals) - scale.angle), np.pi)
        errors.append((error, error[scale.same], scale.angle[scale.same]))
    means = [
        float(np.mean([part.mean() for part in parts])) if parts else np.nan
        for parts in ([e[k] for e in errors if len(e[k])] for k in range(3))
    ]
    return {
        "relative_normal_degrees": float(np.degrees(means[1])),
        "anywhere": means[0] if errors else 0.0,
        "flat": float(np.degrees(means[2])),
    }


def ordered_pairs(depth: Array, mask: Mask, row: int, object_id: Array | None = None) -> Order:
    """Return pairs of the scored pixels of true depth (H, W): ORDERED anywhere, then on objects."""
    pixels = np.flatnonzero(mask)
    if not len(pixels):
        none = np.zeros(0, np.bool_)
        return Order(np.zeros((0, 2), np.int64), none, none, none, none)
    u = spread(ORDERED, 2, row)
    chosen = pixels[np.minimum((u * len(pixels)).astype(np.int64), len(pixels) - 1)]
    if object_id is not None:
        ids = object_id.reshape(-1)[pixels]
        order = np.argsort(ids, kind="stable")
        objects, sorted_ids = pixels[order], ids[order]
        first = int(np.searchsorted(sorted_ids, 1))
        count = len(objects) - first
        if count:
            one = first + np.minimum((u[:, 0] * count).astype(np.int64), count - 1)
            low = np.searchsorted(sorted_ids, sorted_ids[one])
            size = np.searchsorted(sorted_ids, sorted_ids[one], side="right") - low
            other = low + np.minimum((u[:, 1] * size).astype(np.int64), size - 1)
            chosen = np.concatenate([chosen, np.stack([objects[one], objects[other]], axis=1)])
    there = depth.reshape(-1).astype(np.float64)[chosen]
    apart = there.max(axis=1) > RATIO * there.min(axis=1)
    within = between = np.zeros(len(chosen), np.bool_)
    if object_id is not None:
        ids = object_id.reshape(-1)[chosen]
        within, between = (ids[:, 0] == ids[:, 1]) & (ids[:, 0] > 0), ids[:, 0] != ids[:, 1]
    return Order(chosen, there[:, 0] < there[:, 1], apart, within, between)


def ordinal_scores(depth: Array, order: Order) -> dict[str, float]:
    """Return `ordinal_accuracy` of predicted depth (H, W), apart within and between objects.

    That is the fraction of pairs whose true depths differ by RATIO at least that are ordered
    rightly; equal depths are not. `anywhere` is that of all pairs with any true depths, as SAWA-H
    takes it. All are NaN without pairs.
    """
    p = depth.reshape(-1)[order.pixels]
    nearer, farther = p[:, 0] < p[:, 1], p[:, 0] > p[:, 1]
    right = np.where(order.nearer, nearer, farther)
    uniform = np.arange(len(right)) < ORDERED
    asked = {
        "ordinal_accuracy": order.apart & uniform,
        "ordinal_accuracy_within": order.apart & order.within,
        "ordinal_accuracy_between": order.apart & order.between & uniform,
    }
    scores = {n: float(right[at].mean()) if at.any() else np.nan for n, at in asked.items()}
    equal = nearer[uniform] == order.nearer[uniform]
    return scores | {"anywhere": float(equal.mean()) if equal.size else np.nan}


def sawa_h(
    unordered: float, disparity_delta: float, depth_delta: float, boundary_f1: float, turned: float
) -> float:
    """Return SAWA-H, a weighted sum of five errors that agrees with people; lower is better.

    Source: Wu et al. 2025, arXiv 2510.19814, with the weights of its published code.

    Args:
        unordered: fraction of pairs of pixels in another order than the truth's.
        disparity_delta: fraction of pixels within a factor 1.25^(1/8) after disparity was fitted by
            scale and shift in least squares.
        depth_delta: the same with depth fitted instead.
        boundary_f1: as `boundaries.boundary_scores`.
        turned: mean absolute difference of relative normals over pairs anywhere, radians.
    """
    return (
        3.65 * unordered
        + 0.18 * (1.0 - disparity_delta)
        + 0.01 * (1.0 - depth_delta)
        + 0.20 * (1.0 - boundary_f1)
        + 1.94 * turned
    )
