"""Errors of surface normals, and normals derived from depth.

Normals are in the camera frame (x right, y up, looking along -z) and face the viewer. The scored
pixels are the truth's. Angles are in degrees.
"""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from metrics.measures.checks import (
    EmptyError,
    NoDirectionError,
    as_float64,
    require_finite,
    require_fov,
    require_mask,
)
from scenegen.camera import back_project

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

WITHIN_DEGREES = (11.25, 22.5, 30.0)
# A neighbour lies on the same surface if the line to it makes at least this angle with the view.
GRAZING_DEGREES = 10.0
# Variances across and along a patch: less than this is a line, and rounding in single precision.
_THINNEST = 1e-6
_NEIGHBOURS = [(i, j) for i in range(3) for j in range(3) if (i, j) != (1, 1)]


def angular_errors_degrees(
    predicted: ArrayLike, true: ArrayLike, mask: Mask | None = None
) -> Array:
    """Angles (N,), in degrees within [0, 180], between normals (..., 3) of the pixels in the mask.

    angle = atan2(|p x t|, p . t), which needs no unit length and is exact for small angles, where
    acos(p . t) loses half of the digits. The mask (...) defaults to where the truth is finite and
    not zero. Raises NonFiniteError on what is not finite inside the mask, NoDirectionError on a
    vector of length 0, and EmptyError on an empty mask.
    """
    p, t = as_float64(predicted, "predicted normals"), as_float64(true, "true normals")
    if t.ndim < 1 or t.shape[-1] != 3 or p.shape != t.shape:
        raise ValueError(f"expected two arrays (..., 3), got {p.shape} and {t.shape}")
    if mask is None:
        mask = np.asarray(np.isfinite(t).all(axis=-1) & t.any(axis=-1))
    inside = require_mask(mask, t.shape[:-1])
    require_finite(p, "predicted normals", inside)
    require_finite(t, "true normals", inside)
    p, t = _unit(p[inside], "predicted normals"), _unit(t[inside], "true normals")
    cross = np.linalg.norm(np.cross(p, t), axis=-1)
    angles: Array = np.degrees(np.arctan2(cross, (p * t).sum(axis=-1)))
    return angles


def _unit(vectors: Array, what: str) -> Array:
    # Dividing by the largest component first keeps the squares from overflowing or vanishing.
    largest = np.abs(vectors).max(axis=-1, keepdims=True)
    if not largest.all():
        count = np.count_nonzero(largest == 0.0)
        raise NoDirectionError(f"{what}: {count} vectors have length 0")
    scaled = vectors / largest
    unit: Array = scaled / np.linalg.norm(scaled, axis=-1, keepdims=True)
    return unit


def normal_scores(angles: Array) -> dict[str, float]:
    """Mean, median and root mean square in degrees, and the fractions (0 to 1) within limits.

    `normal_mean_degrees`, `normal_median_degrees`, `normal_rmse_degrees`, and
    `normal_within_<degrees>`: the fraction of angles below 11.25, 22.5 and 30 degrees (strictly).
    Source: Fouhey et al. 2013 (Data-Driven 3D Primitives). `angles` (N,) are those of
    `angular_errors_degrees`.
    """
    if angles.size == 0:
        raise EmptyError("no angles to score")
    require_finite(angles, "angles")
    scores = {
        "normal_mean_degrees": float(angles.mean()),
        "normal_median_degrees": float(np.median(angles)),
        "normal_rmse_degrees": float(np.sqrt(np.square(angles).mean())),
    }
    return scores | {f"normal_within_{w:g}": float(np.mean(angles < w)) for w in WITHIN_DEGREES}


def normals_from_depth(
    depth: ArrayLike, fov_y_degrees: float, mask: Mask | None = None
) -> tuple[Array, Mask]:
    """Unit normals (H, W, 3) of planar depth (H, W), and where they rest on a surface (H, W).

    The normal of the plane through the pixel and its 8 neighbours that minimises the sum of squared
    distances (total least squares, Hoppe et al. 1992), with n . ray < 0: facing the
    viewer. Neighbours outside the image or the mask (default: finite depth) do not count, nor does
    one across a depth discontinuity: where the line from the pixel to it is within 10 degrees of
    the viewing ray. If the rest lie on one line, or are fewer than 2, all neighbours in the mask
    count after all; if those do not span a plane either, the normal points at the viewer.

    The second array tells where the first rule sufficed. Score where it holds for the truth: a
    prediction has a normal at every pixel of the mask, so ragged depth takes no pixel out of
    the score. Outside the mask normals are 0.
    """
    planar = as_float64(depth, "depth")
    if planar.ndim != 2:
        raise ValueError(f"depth must have shape (H, W), got {planar.shape}")
    inside = require_mask(np.isfinite(planar) if mask is None else mask, planar.shape)
    require_finite(planar, "depth", inside)
    require_fov(fov_y_degrees)
    rays = np.moveaxis(back_project(np.ones(planar.shape), fov_y_degrees), -1, 0)
    rays = rays / np.linalg.norm(rays, axis=0)
    points = np.moveaxis(back_project(np.where(inside, planar, 1.0), fov_y_degrees), -1, 0)
    steps, counted, near = _neighbours(points, rays, inside)
    normals, on_surface = _fit_planes(steps, near)
    on_surface &= inside
    rest = inside & ~on_surface
    loose, spanned = _fit_planes(steps[:, :, rest], counted[:, rest])
    normals[:, rest] = np.where(spanned, loose, -rays[:, rest])
    normals *= np.where(inside, -np.copysign(1.0, (normals * rays).sum(axis=0)), 0.0)
    return np.moveaxis(normals, 0, -1), on_surface


def _neighbours(points: Array, rays: Array, inside: Mask) -> tuple[Array, Mask, Mask]:
    """Steps (8, 3, H, W) to the neighbours, which are in the mask, and which are near as well."""
    height, width = inside.shape
    padded, padded_inside = np.pad(points, ((0, 0), (1, 1), (1, 1))), np.pad(inside, 1)
    windows = [(..., slice(i, i + height), slice(j, j + width)) for i, j in _NEIGHBOURS]
    steps = np.stack([padded[window] - points for window in windows])
    counted = np.stack([padded_inside[window] for window in windows]) & inside
    steps *= counted[:, None]
    # The shape of the patch is all that matters: with its size taken out, no power overflows.
    size = np.abs(steps).max(axis=(0, 1))
    steps /= np.where(size > 0.0, size, 1.0)
    along, lengths = (steps * rays).sum(axis=1), np.square(steps).sum(axis=1)
    grazing = math.cos(math.radians(GRAZING_DEGREES)) ** 2
    return steps, counted, counted & (np.square(along) <= grazing * lengths)


def _fit_planes(steps: Array, counted: Mask) -> tuple[Array, Mask]:
    """Unit normals (3, ...) of the planes through a point and its counted steps (8, 3, ...).

    The second array (...) is false where the points lie on one line or coincide.
    """
    number = 1.0 + counted.sum(axis=0)
    kept = steps * counted[:, None]
    mean = kept.sum(axis=0) / number
    scatter = {
        (a, b): (kept[:, a] * kept[:, b]).sum(axis=0) / number - mean[a] * mean[b]
        for a, b in ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2))
    }
    return _least_axis(*scatter.values())


def _least_axis(
    xx: Array, yy: Array, zz: Array, xy: Array, yz: Array, xz: Array
) -> tuple[Array, Mask]:
    """Unit eigenvectors (3, ...) of the smallest eigenvalue of symmetric 3 x 3 matrices.

    The second array (...) is false where two eigenvalues all but vanish or all three agree. In
    closed form (Smith 1961): a general solver takes longer than the rest of this module.
    """
    third = (xx + yy + zz) / 3.0
    x, y, z = xx - third, yy - third, zz - third
    spread = np.sqrt((x * x + y * y + z * z + 2.0 * (xy * xy + yz * yz + xz * xz)) / 6.0)
    half = (x * (y * z - yz * yz) - xy * (xy * z - yz * xz) + xz * (xy * yz - y * xz)) / 2.0
    cube = spread**3
    cosine = np.divide(half, cube, out=np.ones_like(half), where=cube > 0.0)
    angle = np.arccos(np.clip(cosine, -1.0, 1.0)) / 3.0
    largest = third + 2.0 * spread * np.cos(angle)
    least = third + 2.0 * spread * np.cos(angle + 2.0 * math.pi / 3.0)
    rows = np.array([[xx - least, xy, xz], [xy, yy - least, yz], [xz, yz, zz - least]])
    # Any two independent rows are normal to the eigenvector; the longest product is the safest.
    candidates = np.stack([np.cross(rows[i], rows[i - 1], axis=0) for i in range(3)])
    lengths = np.linalg.norm(candidates, axis=1)
    best = lengths.argmax(axis=0)[None]
    axis = np.take_along_axis(candidates, best[:, None], axis=0)[0]
    length = np.take_along_axis(lengths, best, axis=0)[0]
    middle = 3.0 * third - largest - least
    # All rows vanish when the eigenvalues are all the same: no axis is the least.
    clear = (middle > _THINNEST * largest) & (length > 1e-12 * largest * largest)
    return axis / np.where(clear, length, 1.0), clear
