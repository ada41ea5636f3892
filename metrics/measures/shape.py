"""Shape inside objects: what a flat cut-out of an object cannot win.

The truth's ids say which pixels show which object. Only pixels inside are scored: those whose 8
neighbours show the same object, of objects with at least LEAST_INSIDE of them. Outline and distance
of an object have no part in these scores.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from metrics.measures.objects import counted_objects

Array = NDArray[Any]

LEAST_INSIDE = 16  # pixels
RECALL_WITHIN = 0.02  # scene units
# Scene units. A predicted surface that bends less counts as bending so much: else rounding could be
# taken for shape.
LEAST_BEND = 1e-3
FLAT = 1e-5  # scene units: true surfaces that bend less have no correlation


def inside_objects(object_id: Array) -> Array:
    """Return the object of each pixel inside one, (H, W); 0 at all other pixels.

    Pixels on the edge of the picture are not inside.
    """
    height, width = object_id.shape
    ids = np.where(counted_objects(object_id), object_id, 0).astype(np.int64)
    padded = np.pad(ids, 1)
    alike = np.logical_and.reduce(
        [padded[i : i + height, j : j + width] == ids for i, j in np.ndindex(3, 3)]
    )
    inside = np.where(alike, ids, 0)
    pixels = np.bincount(inside.ravel())
    return np.where(pixels[inside] >= LEAST_INSIDE, inside, 0)


def _each(inside: Array) -> Iterator[Array]:
    """Yield which of the pixels (N,) belong to each object."""
    for number in np.unique(inside).tolist():
        yield inside == number


def shape_scores(
    errors: Array, points: Array, true_points: Array, inside: Array
) -> dict[str, float]:
    """Return the scores of the shape inside objects, all NaN without any object.

    - shape_error: mean |e - median(e)|, with e the departure at a pixel and the median, of each
      column, over the pixels of its object: what is left after each object's own shift.
    - shape_recall_0.02: fraction of the objects whose own shape_error is below RECALL_WITHIN.
    - shape_correlation: correlation of what predicted and true depth have left after the plane of
      each object, the least-squares fit of depth to the points of its pixels. A predicted rest of a
      standard deviation below LEAST_BEND, or below the true one if that is smaller, counts as
      having that. NaN where the true rest is flat.

    Args:
        errors: departures of the N pixels inside objects, (N, K), as from `points.departures`.
        points, true_points: predicted and true, camera frame, (N, 3), scene units.
        inside: the object of each, (N,).
    """
    names = ("shape_error", f"shape_recall_{RECALL_WITHIN:g}", "shape_correlation")
    if not len(inside):
        return dict.fromkeys(names, np.nan)
    left, found = np.empty(len(inside)), []
    rests = np.empty((2, len(inside)))
    for mask in _each(inside):
        own = errors[mask]
        left[mask] = np.sqrt(np.square(own - np.median(own, axis=0)).sum(axis=-1))
        found.append(float(left[mask].mean()) < RECALL_WITHIN)
        for rest, cloud in zip(rests, (points, true_points), strict=True):
            rest[mask] = _beside_plane(cloud[mask])
    p, t = rests
    variance = float((t * t).mean())
    correlation = np.nan
    if variance > FLAT**2:
        least = max(float((p * p).mean()), min(LEAST_BEND**2, variance))
        correlation = float(np.clip((p * t).mean() / np.sqrt(least * variance), -1.0, 1.0))
    return dict(zip(names, (float(left.mean()), float(np.mean(found)), correlation), strict=True))


def _beside_plane(points: Array) -> Array:
    """Return the depth of points (N, 3), up to sign, without its least-squares plane z(x, y)."""
    x, y, z = (axis / (float(np.abs(axis).max()) or 1.0) for axis in points.T)
    basis, r = np.linalg.qr(np.stack([np.ones_like(x), x, y], axis=1))
    basis = basis[:, np.abs(np.diag(r)) > 1e-9]  # without x and y that say nothing
    return np.asarray((z - basis @ (basis.T @ z)) * float(np.abs(points[:, 2]).max()))


def flat_error(true_depth: Array, inside: Array) -> float:
    """Return the shape_error of a flat cut-out: of each object at its median depth; NaN without."""
    if not len(inside):
        return np.nan
    left = np.empty(len(inside))
    for mask in _each(inside):
        left[mask] = np.abs(true_depth[mask] - np.median(true_depth[mask]))
    return float(left.mean())


def one_normal_degrees(normals: Array, inside: Array) -> float:
    """Return the mean angle, degrees, between unit normals (N, 3) and their object's mean one.

    That is the single normal of an object with the least mean squared distance. NaN without any.
    """
    if not len(inside):
        return np.nan
    normals, angles = normals.astype(np.float64), np.empty(len(inside))
    for mask in _each(inside):
        mean = normals[mask].mean(axis=0)
        cosine = normals[mask] @ mean / max(float(np.linalg.norm(mean)), 1e-12)
        angles[mask] = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
    return float(angles.mean())
