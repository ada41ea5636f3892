"""Errors of point maps: predicted against true surface points of the same pixels.

Source: Wang et al. 2025 (MoGe), section 4 and its published evaluation.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from metrics.measures.alignment import Alignment, align_points

Array = NDArray[Any]
WITHIN = 0.25


def point_map_scores(
    points: Array, true_points: Array, alignment: Alignment = "none"
) -> dict[str, float]:
    """Return `points_rel` and `points_delta_1` of points (N, 3) after an alignment.

    - points_rel: mean |p - t| / |t|, distances from the camera.
    - points_delta_1: fraction with |p - t| < WITHIN min(|p|, |t|).

    With an alignment the names end in `_after_` and its name.
    """
    p, t = align_points(points, true_points, alignment), true_points
    errors, far, said = map(_lengths, (p - t, t, p))
    ending = "" if alignment == "none" else f"_after_{alignment}"
    return {
        f"points_rel{ending}": float((errors / far).mean()),
        f"points_delta_1{ending}": float(np.mean(errors < WITHIN * np.minimum(said, far))),
    }


def _lengths(vectors: Array) -> Array:
    """Return what numpy's norm of vectors (N, 3) does, in a fifth of its time."""
    x, y, z = vectors.T
    return np.asarray(np.sqrt(x * x + y * y + z * z))


def departures(points: Array, true_depth: Array, rays: Array, on_rays: bool) -> Array:
    """Return how far points (N, 3) are from the true ones of their pixels, (N, K), scene units.

    The first column is predicted minus true depth. Points that are not all on the rays (N, 3) of
    their pixels, which have z = -1, have two more: x and y minus those of the ray at their depth.
    So the length of a row is the error of depth where a point lies on its ray.
    """
    depth = -points[:, 2]
    if on_rays:
        return np.asarray((depth - true_depth)[:, None])
    aside = points[:, :2] - depth[:, None] * rays[:, :2]
    return np.concatenate([(depth - true_depth)[:, None], aside], axis=1)


def pixels_off_rays(points: Array, rays: Array, pitch: float) -> Array:
    """Return how far from its pixel's centre the camera sees each point, (N,), in pixels.

    Infinite for points that are not in front of the camera.

    Args:
        points: camera frame, (N, 3).
        rays: those of their pixels, (N, 3), with z = -1.
        pitch: the pixel size on the plane at depth 1.
    """
    ahead = points[:, 2] < 0.0
    depth = np.where(ahead, -points[:, 2], 1.0)[:, None]
    off = np.linalg.norm(points[:, :2] / depth - rays[:, :2], axis=-1) / pitch
    return np.asarray(np.where(ahead, off, np.inf))


def ray_error_degrees(points: Array, rays: Array) -> float:
    """Return the mean angle, degrees, between points (N, 3) and the rays (N, 3) of their pixels.

    A point at the camera has no direction and counts as 180 degrees.
    """
    size = _lengths(points)
    cosine = (points * rays).sum(axis=1) / np.maximum(size * _lengths(rays), np.finfo(float).tiny)
    sine = _lengths(np.cross(points, rays)) / np.maximum(
        size * _lengths(rays), np.finfo(float).tiny
    )
    angle = np.degrees(np.arctan2(sine, cosine))
    return float(np.where(size > 0.0, angle, 180.0).mean())


def local_point_scores(points: Array, true_points: Array, object_id: Array) -> dict[str, float]:
    """Return `local_points_rel` and `local_points_delta_1`: means over objects, each fitted alone.

    The points of an object are aligned by scale and shift in least squares (MoGe: by L1). Its
    errors are divided by its diameter, the longest side of the box along the axes of the camera
    around its true points.

    Args:
        points, true_points: (N, 3) each.
        object_id: of each; above 0 where an object that counts is seen, (N,).
    """
    errors = []
    order = np.argsort(object_id, kind="stable")
    order = order[np.searchsorted(object_id[order], 1) :]
    ends = np.flatnonzero(np.diff(object_id[order])) + 1
    for own in np.split(order, ends) if len(order) else ():
        t = true_points[own]
        diameter = float(np.ptp(t, axis=0).max())
        apart = _lengths(align_points(points[own], t, "scale_shift") - t)
        errors.append(apart / max(diameter, np.finfo(np.float64).tiny))
    rel = float(np.mean([error.mean() for error in errors])) if errors else np.nan
    within = float(np.mean([np.mean(error < WITHIN) for error in errors])) if errors else np.nan
    return {"local_points_rel": rel, "local_points_delta_1": within}
