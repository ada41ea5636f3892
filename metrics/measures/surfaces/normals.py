"""Errors of surface normals, and normals derived from depth.

Normals are in the camera frame (x right, y up, looking along -z) and face the viewer. The truth
decides which pixels are scored. Angles are in degrees. The paper reports no errors of normals.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from metrics.measures.checks import (
    NoDirectionError,
    as_float64,
    require,
    require_finite,
    require_fov,
    require_mask,
)
from scenegen.camera import Lens, back_project, pixel_directions

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

WITHIN_DEGREES = (5.0, 7.5, 11.25, 22.5, 30.0)
# The line to a neighbour on the same surface makes at least this angle with the viewing ray.
GRAZING_DEGREES = 10.0
# Smallest ratio of the middle to the largest variance of a patch. A patch below it is a line; the
# middle variance may then be rounding in single precision.
_THINNEST = 1e-6
_EDGE_ON = 1e-4  # cosine of normal and ray; the closed form below is off by up to 1e-5
_STRIP = 8192  # pixels handled at a time, so that what is computed fits into a core's cache
_NEIGHBOURS = [(i, j) for i in range(3) for j in range(3) if (i, j) != (1, 1)]


def angular_errors_degrees(
    predicted: ArrayLike, true: ArrayLike, mask: Mask | None = None
) -> Array:
    """Return angles (N,), degrees in [0, 180], between normals (..., 3) of the pixels in the mask.

    The formula is atan2(|p x t|, p . t). It needs no unit length and is exact for small angles,
    where acos(p . t) loses half of the digits. The mask (...) defaults to the pixels where the
    truth is finite and not zero.

    Raises NonFiniteError where a vector inside the mask is not finite, NoDirectionError where its
    length is 0, EmptyError on an empty mask, and MeasureError on shapes that do not agree.
    """
    p, t = as_float64(predicted, "predicted normals"), as_float64(true, "true normals")
    ok = t.ndim >= 1 and t.shape[-1] == 3 and p.shape == t.shape
    require(ok, "normals", f"shapes {p.shape} and {t.shape}", "two arrays (..., 3) of one shape")
    if mask is None:
        mask = np.asarray(np.isfinite(t).all(axis=-1) & t.any(axis=-1))
    inside = require_mask(mask, t.shape[:-1])
    require_finite(p, "predicted normals", inside)
    require_finite(t, "true normals", inside)
    a, b = _unit(p[inside], "predicted normals"), _unit(t[inside], "true normals")
    angles: Array = np.degrees(np.arctan2(_length(_cross(a, b)), _dot(a, b)))
    return angles


# Components lie apart, (3, ...): sums over the last axis of (..., 3) take several times as long.
def _dot(a: Array, b: Array) -> Array:
    return np.asarray(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


def _length(a: Array) -> Array:
    return np.sqrt(_dot(a, a))


def _cross(a: Sequence[Array] | Array, b: Sequence[Array] | Array) -> Array:
    x, y, z = a
    u, v, w = b
    return np.stack([y * w - z * v, z * u - x * w, x * v - y * u])


def _unit(vectors: Array, what: str) -> Array:
    """Return unit vectors (3, N) of vectors (N, 3)."""
    parts = np.ascontiguousarray(vectors.T)
    # Dividing by the largest component first keeps the squares from overflowing or vanishing.
    largest = np.abs(parts).max(axis=0)
    if not largest.all():
        count = np.count_nonzero(largest == 0.0)
        raise NoDirectionError(what, f"{count} vectors of length 0", "directions")
    scaled = parts / largest
    return np.asarray(scaled / _length(scaled))


def normal_scores(angles: Array) -> dict[str, float]:
    """Return the scores of angles (N,), in degrees, by name.

    These are `normal_mean_degrees`, `normal_median_degrees`, `normal_rmse_degrees` (the root mean
    square), and `normal_within_<limit>`: the fractions, 0 to 1, of angles below WITHIN_DEGREES.
    Sources: Fouhey et al. 2013 (Data-Driven 3D Primitives) for 11.25, 22.5 and 30; Bae and Davison
    2024 (DSINE) for 5 and 7.5. All are NaN without angles.
    """
    require_finite(angles, "angles")
    if not angles.size:
        angles = np.full(1, np.nan)
    scores = {
        "normal_mean_degrees": float(angles.mean()),
        "normal_median_degrees": float(np.median(angles)),
        "normal_rmse_degrees": float(np.sqrt(np.square(angles).mean())),
    }
    within = {w: np.where(np.isnan(angles), np.nan, angles < w).mean() for w in WITHIN_DEGREES}
    return scores | {f"normal_within_{w:g}": float(share) for w, share in within.items()}


def normals_from_depth(
    depth: ArrayLike, lens: Lens | float, mask: Mask | None = None
) -> tuple[Array, Mask]:
    """Return `normals_from_points` of planar depth (H, W), on the rays of its pixels."""
    planar = as_float64(depth, "depth")
    require(planar.ndim == 2, "depth", f"shape {planar.shape}", "(H, W)")
    require_fov(lens)
    inside = require_mask(np.isfinite(planar) if mask is None else mask, planar.shape)
    require_finite(planar, "depth", inside)
    return normals_from_points(back_project(planar, lens), lens, inside)


def normals_from_points(points: ArrayLike, lens: Lens | float, mask: Mask) -> tuple[Array, Mask]:
    """Return unit normals (H, W, 3) of points (H, W, 3), and where they are reliable (H, W).

    A normal is that of the plane that minimises the sum of squared distances to the points of the
    pixel and its 8 neighbours (total least squares, Hoppe et al. 1992), and faces the viewer. A
    neighbour does not count if it is outside the image or the mask, or
    across a depth discontinuity: if the line to it is within 10 degrees of the viewing ray. Where
    fewer than 2 are left, all lie on one line, or the plane is seen edge-on, every neighbour in the
    mask counts; if those do not tell a plane either, the normal points at the viewer. Outside the
    mask normals are 0.

    Normals are reliable where the first rule sufficed. Score the pixels where that holds for the
    truth. A prediction has a normal at every pixel of the mask, so that noisy depth takes no pixel
    out of the score.
    """
    inside = require_mask(mask, np.shape(points)[:2])
    image = np.where(inside[..., None], as_float64(points, "points"), 0.0)
    require_finite(image, "points")
    height, width = inside.shape
    rays = np.ascontiguousarray(np.moveaxis(pixel_directions(height, width, lens), -1, 0))
    rays /= _length(rays)
    parts = np.ascontiguousarray(np.moveaxis(image, -1, 0))
    normals, reliable = np.empty((3, height, width)), np.empty((height, width), np.bool_)
    tall = max(_STRIP // width, 1)
    for top in range(0, height, tall):  # with a row above and below, as neighbours
        low, high = max(top - 1, 0), min(top + tall + 1, height)
        found, good = _fitted(parts[:, low:high], rays[:, low:high], inside[low:high])
        here, kept = slice(top, top + tall), slice(top - low, top - low + tall)
        normals[:, here], reliable[here] = found[:, kept], good[kept]
    return np.moveaxis(normals, 0, -1), reliable


def _fitted(points: Array, rays: Array, inside: Mask) -> tuple[Array, Mask]:
    """Return normals (3, H, W) of points (3, H, W) with unit rays, and where they are reliable."""
    steps, counted, near = _neighbours(points, rays, inside)
    normals, on_surface = _fit_planes(steps, near, rays)
    on_surface &= inside
    rest = inside & ~on_surface
    if rest.any():
        loose, spanned = _fit_planes(steps[:, :, rest], counted[:, rest], rays[:, rest])
        normals[:, rest] = np.where(spanned, loose, -rays[:, rest])
    normals *= np.where(inside, -np.copysign(1.0, _dot(normals, rays)), 0.0)
    return normals, on_surface


def _neighbours(points: Array, rays: Array, inside: Mask) -> tuple[Array, Mask, Mask]:
    """Steps (8, 3, H, W) to the neighbours; which are in the mask; which are near as well."""
    height, width = inside.shape
    padded, padded_inside = np.zeros((3, height + 2, width + 2)), np.pad(inside, 1)
    padded[:, 1:-1, 1:-1] = points
    steps = np.empty((8, 3, height, width))
    counted, near = np.empty((2, 8, height, width), bool)
    size = np.zeros((height, width))
    for step, count, (i, j) in zip(steps, counted, _NEIGHBOURS, strict=True):
        window = (..., slice(i, i + height), slice(j, j + width))
        np.subtract(padded[window], points, out=step)
        np.logical_and(padded_inside[window], inside, out=count)
        np.multiply(step, count.astype(float), out=step)
        np.maximum(size, np.abs(step).max(axis=0), out=size)
    # Only the shape of the patch matters. Dividing by its size keeps powers from overflowing.
    size[size == 0.0] = 1.0
    grazing = math.cos(math.radians(GRAZING_DEGREES)) ** 2
    along, lengths, product = np.empty((3, height, width))
    for step, count, close in zip(steps, counted, near, strict=True):
        np.divide(step, size, out=step)
        _dot_into(along, step, rays, product)
        _dot_into(lengths, step, step, product)
        np.square(along, out=along)
        lengths *= grazing
        np.less_equal(along, lengths, out=close)
        np.logical_and(close, count, out=close)
    return steps, counted, near


def _dot_into(out: Array, a: Array, b: Array, buffer: Array) -> None:
    """Write the scalar products of vectors (3, ...) to an array (...)."""
    np.multiply(a[0], b[0], out=out)
    for x, y in zip(a[1:], b[1:], strict=True):
        out += np.multiply(x, y, out=buffer)


def _fit_planes(steps: Array, counted: Mask, rays: Array) -> tuple[Array, Mask]:
    """Unit normals (3, ...) of the planes through a point and its counted steps (8, 3, ...).

    The second array (...) is false where the points lie on one line or coincide, and where the
    plane holds the pixel's ray (3, ...), as it does for pixels of one row or column: rounding would
    choose which side of it faces the viewer.
    """
    number = 1.0 + counted.sum(axis=0)
    all_counted = counted.all()
    mean, scatter = np.zeros(steps.shape[1:]), np.zeros((6, *steps.shape[2:]))
    product = np.empty(steps.shape[2:])
    pairs = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2))
    for step, count in zip(steps, counted, strict=True):
        kept = step if all_counted else step * count.astype(float)
        mean += kept
        for k, (a, b) in enumerate(pairs):
            scatter[k] += np.multiply(kept[a], kept[b], out=product)
    mean /= number
    scatter /= number
    for k, (a, b) in enumerate(pairs):
        scatter[k] -= np.multiply(mean[a], mean[b], out=product)
    normals, clear = _least_axis(*scatter)
    return normals, clear & (np.abs(_dot(normals, rays)) > _EDGE_ON)


def _least_axis(
    xx: Array, yy: Array, zz: Array, xy: Array, yz: Array, xz: Array
) -> tuple[Array, Mask]:
    """Unit eigenvectors (3, ...) of the smallest eigenvalue of symmetric 3 x 3 matrices.

    The second array (...) is false where two eigenvalues are nearly 0 or all three are equal. This
    is the closed form of Smith 1961, as a general solver takes longer than the rest of this module.
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
    rows = (xx - least, xy, xz), (xy, yy - least, yz), (xz, yz, zz - least)
    # The cross product of two independent rows is the eigenvector; the longest one is most exact.
    axis = _cross(rows[0], rows[2])
    length = _dot(axis, axis)
    for i in (1, 2):
        other = _cross(rows[i], rows[i - 1])
        square = _dot(other, other)
        longer = square > length
        np.copyto(axis, other, where=longer)
        np.copyto(length, square, where=longer)
    length = np.sqrt(length)
    middle = 3.0 * third - largest - least
    # With three equal eigenvalues all rows are 0, and there is no smallest axis.
    clear = (middle > _THINNEST * largest) & (length > 1e-12 * largest * largest)
    return axis / np.where(clear, length, 1.0), clear
