"""Exact nearest neighbours between two depth images of one camera, faster than a tree.

Both clouds have one point on the ray of each pixel. The distance to the other cloud's point at the
same pixel is an upper bound of the nearest distance. The rays give a lower bound: all points on
rays k columns away lie in one plane through the camera, and a point at depth z is at least
z k pitch / sqrt(1 + e^2) from that plane, where e is the largest |x| on the image plane at depth 1;
the same holds for rows. A point is settled once its best distance so far is below the lower bound
of all pixels not yet searched.

The search visits square rings of growing radius, for all pixels and both directions at once, as
long as the next rings are certain to settle enough points to be worth their time. The points that
are still open then go to a kd-tree. Good predictions settle in the first rings; for bad ones, a few
passes over the image are wasted before the tree is built.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from metrics.measures.checks import require, require_depth_pair, require_fov
from metrics.measures.surfaces.chamfer_hausdorff import NearestDistances, query_nearest
from scenegen.camera import Lens, as_lens, pixel_directions

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_LARGEST_RING = 8
# Measured costs, in units of one look (comparing one pixel with one neighbour): a query of the
# tree, its extra cost for each ring of distance (far queries visit more leaves), building the tree,
# per point, and the overhead of a pass over all pixels. Wrong values cost time, never exactness.
_QUERY_LOOKS = 85.0
_QUERY_LOOKS_PER_RING = 40.0
_BUILD_LOOKS = 20.0
CALL_LOOKS = 3000.0
# Elements handled at a time, so that they fit into the second-level cache.
_STRIP = 8192
# Rounding changes distances by about 1e-13 of a pixel pitch, far less than this margin.
_BOUND_MARGIN = 1.0 - 1e-9
# Coordinate of missing points, far from all others; the other cloud's is the negative of it.
_NOWHERE = 1e110


def nearest_distances_on_image(
    predicted_depth: ArrayLike,
    true_depth: ArrayLike,
    lens: Lens | float,
    mask: Mask | None = None,
) -> NearestDistances:
    """Return nearest distances both ways between the surfels of two planar depth images (H, W).

    The result equals `chamfer_hausdorff.nearest_distances` of the back-projected points of the
    pixels in `mask` (default: where the truth is finite), in row-major order and in the unit of the
    depth, for any prediction. Raises NonFiniteError where depth inside the mask is not finite,
    EmptyError on an empty mask, and MeasureError on other shapes.
    """
    predicted, true, inside = require_depth_pair(predicted_depth, true_depth, mask)
    require_fov(lens)
    require(inside.ndim == 2, "depth", f"shape {inside.shape}", "(H, W)")
    grid = _Grid(inside)
    clouds = _lay_out_clouds(grid, predicted, true, lens)
    per_ring = _rings_per_distance(grid, clouds[:, 2], lens)
    best = np.empty((2, grid.size))
    best[0] = _squared_distances(clouds[0], clouds[1])
    best[1] = best[0]
    ring = 0
    reach = np.sqrt(best)
    reach *= per_ring
    while _next_rings_pay(reach, ring):
        ring += 1
        _look_at_ring(clouds, best, grid, ring)
        np.sqrt(best, out=reach)
        reach *= per_ring
    unsettled = reach > ring + 1
    return NearestDistances(
        _finish(grid, clouds[0], clouds[1], best[0], unsettled[0]),
        _finish(grid, clouds[1], clouds[0], best[1], unsettled[1]),
    )


class _Grid:
    """An image laid out in one dimension, with room before and after it for the largest ring.

    A step by rows and columns is then a shift of the index. A step across the side of the image
    ends in another row, which costs a needless look at a true distance and so does no harm.
    """

    def __init__(self, inside: Mask) -> None:
        self.inside = inside
        height, width = inside.shape
        self.start = _LARGEST_RING * (width + 1)
        self.stop = self.start + height * width
        self.size = self.stop + self.start
        self.present = np.zeros(self.size, dtype=np.bool_)
        self.image(self.present)[...] = inside

    def image(self, flat: NDArray[Any]) -> NDArray[Any]:
        """The image (..., H, W) inside an array (..., size), as a view."""
        return flat[..., self.start : self.stop].reshape(*flat.shape[:-1], *self.inside.shape)


def _lay_out_clouds(grid: _Grid, predicted: Array, true: Array, lens: Lens | float) -> Array:
    """Prediction and truth back-projected: (2, 3, size)."""
    height, width = grid.inside.shape
    rays = pixel_directions(height, width, lens)
    slopes = (rays[:1, :, 0], rays[:, :1, 1], rays[:1, :1, 2])
    clouds = np.empty((2, 3, grid.size))
    for cloud, depth, nowhere in zip(clouds, (predicted, true), (_NOWHERE, -_NOWHERE), strict=True):
        cloud[...] = nowhere
        filled = np.where(grid.inside, depth, 1.0)
        for flat, slope in zip(cloud, slopes, strict=True):
            image = grid.image(flat)
            np.multiply(filled, slope, out=image)
            np.copyto(image, nowhere, where=~grid.inside)
    return clouds


def _rings_per_distance(grid: _Grid, z: Array, lens: Lens | float) -> Array:
    """Return how many rings a distance of 1 spans at most, (2, size): 1 / the bound of one ring.

    It is 0 where there is no point, so that nothing is ever open there. A point at depth 0 has no
    lower bound, and no ring settles it.
    """
    height, width = grid.inside.shape
    pixels = as_lens(lens).grid(height, width)
    edge = float(np.abs(pixel_directions(height, width, lens)[..., :2]).max())
    pitch = min(pixels.across, pixels.down)
    bound = pitch / math.sqrt(1.0 + edge * edge) * _BOUND_MARGIN
    per_ring: Array = (1.0 / bound) / np.maximum(np.abs(z), 1e-100)
    per_ring *= grid.present
    return per_ring


def _next_rings_pay(reach: Array, ring: int) -> bool:
    """Tell whether searching up to some larger ring costs less than the tree queries it saves.

    `reach` is the best distance so far, in rings. It can only fall, so a point is certainly settled
    after ring ceil(reach) - 1; only queries that are certain to be saved count.
    """
    rings = np.arange(ring + 1, _LARGEST_RING + 1)
    shifts = np.square(2.0 * rings + 1.0) - (2 * ring + 1) ** 2
    looks = shifts * (reach.shape[1] + CALL_LOOKS)
    saved = np.zeros(len(rings))
    for one_way in reach:
        left = np.array([np.count_nonzero(one_way > r) for r in range(ring + 1, _LARGEST_RING + 2)])
        saved += np.cumsum(-np.diff(left) * (_QUERY_LOOKS + _QUERY_LOOKS_PER_RING * rings))
        if left[0] > 0:
            saved += np.where(left[1:] == 0, _BUILD_LOOKS * reach.shape[1], 0.0)
    return bool((saved > looks).any())


def _squared_distances(a: Array, b: Array) -> Array:
    """Return squared distances (...) between points (3, ...), added in the order x, y, z."""
    total: Array = np.square(a[0] - b[0])
    total += np.square(a[1] - b[1])
    total += np.square(a[2] - b[2])
    return total


def _look_at_ring(clouds: Array, best: Array, grid: _Grid, ring: int) -> None:
    """Lower `best`, squared distances, in place by all pairs of pixels exactly `ring` apart."""
    steps = range(-ring, ring + 1)
    width = grid.inside.shape[1]
    shifts = [i * width + j for i in steps for j in steps if max(abs(i), abs(j)) == ring]
    buffers = np.empty((2, _STRIP))
    for low in range(grid.start, grid.stop, _STRIP):
        high = min(low + _STRIP, grid.stop)
        total, part = buffers[:, : high - low]
        here, nearest = clouds[0, :, low:high], best[0, low:high]
        for shift in shifts:
            there = clouds[1, :, low + shift : high + shift]
            np.subtract(here[0], there[0], out=part)
            np.multiply(part, part, out=total)
            for axis in (1, 2):
                np.subtract(here[axis], there[axis], out=part)
                np.multiply(part, part, out=part)
                np.add(total, part, out=total)
            np.minimum(nearest, total, out=nearest)
            other_nearest = best[1, low + shift : high + shift]
            np.minimum(other_nearest, total, out=other_nearest)


def _finish(grid: _Grid, cloud: Array, other: Array, squared: Array, unsettled: Mask) -> Array:
    """Distances (N,) of a cloud's points, the unsettled ones by a tree of the other cloud."""
    distances = np.sqrt(squared)
    if unsettled.any():
        places, present = np.flatnonzero(unsettled), np.flatnonzero(grid.present)
        data = np.ascontiguousarray(other.take(present, axis=1).T)
        queries = np.ascontiguousarray(cloud.take(places, axis=1).T)
        distances[places] = query_nearest(data, queries)
    return grid.image(distances)[grid.inside]
