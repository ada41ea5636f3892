"""Distances between two surfaces that are seen in one picture: more than those of their points.

A pixel has a point of a surface and the normal there. They tell a patch of it: a disc around the
point, in the tangent plane. A point that lies on the surface between two pixels is near their
patches, although it is half a pixel away from either point. So these distances hardly depend on the
number of pixels. Of the truth the normals are exact. Of a prediction they are derived from its
points, by `normals`.

With a point q, the point p and the normal n of a patch, and the pixel size s on the plane at depth
1, the distance from q to the patch is

    sqrt(h^2 + max(0, l - r)^2)
    h = n . (q - p)                            off the tangent plane
    l = sqrt(|q - p|^2 - h^2)                  along it
    r = REACH s z / max(-n . p / |p|, LEAST_COSINE),   z the depth of p, or 0 behind the camera

Predicted points are measured against true patches, and true points against predicted patches. A
predicted point and a true pixel are close if the camera sees the point in that pixel or in one of
the 8 around it. The distance from a point to a surface is the least of those to the patches of
close pixels and those to all its points. The latter matters only where no close patch is near, and
there half a pixel is little.

Source: the patches are the surfels of Pfister et al. 2000 (Surfels); the distance is our own.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from metrics.measures.surfaces.chamfer_hausdorff import NearestDistances
from scenegen.camera import Lens, as_lens, pixel_size

Array = NDArray[Any]
Mask = NDArray[np.bool_]

REACH = 1.5  # pixels
# A patch seen more from the side reaches no farther: outlines of round objects would be endless.
LEAST_COSINE = 0.3
STRIP = 8192  # pixels handled at a time, so that buffers fit into a core's cache
NOWHERE = 1e100  # coordinates of missing points; their squares are finite


@dataclass(frozen=True)
class Surface:
    """The patches of the N scored pixels of an image.

    Attributes:
        mask: the scored pixels, (H, W).
        points: camera frame, scene units, (N, 3), in row-major order.
        lens: of the camera.
        patches: x, y, z, the normal, and the reach of each pixel's patch, (7, H + 2, W + 2), with a
            border of one pixel; NOWHERE, with a normal of 0, where there is no point.
    """

    mask: Mask
    points: Array
    lens: Lens | float
    patches: Array


def surface_of(points: Array, normals: Array, lens: Lens | float, mask: Mask) -> Surface:
    """Return the surface of points and unit normals (N, 3), camera frame, of a mask (H, W)."""
    values = np.empty((7, len(points)))
    values[:3], values[3:6] = points.T, normals.T
    x, y, z, *n = values[:6]
    far = np.maximum(np.sqrt(x * x + y * y + z * z), np.finfo(float).tiny)
    cosine = -(x * n[0] + y * n[1] + z * n[2]) / far
    values[6] = (
        REACH * pixel_size(len(mask), lens) * np.maximum(-z, 0.0) / np.maximum(cosine, LEAST_COSINE)
    )
    patches = np.zeros((7, mask.shape[0] + 2, mask.shape[1] + 2))
    patches[:3] = NOWHERE
    patches[:, 1:-1, 1:-1][:, mask] = values
    return Surface(mask, points, lens, patches)


def surface_distances(
    predicted: Surface, true: Surface, nearest: NearestDistances, on_rays: bool
) -> NearestDistances:
    """Return the distances between two surfaces of one mask: (N,) both ways.

    Args:
        nearest: the distances both ways between their points.
        on_rays: whether each predicted point lies on the ray of its pixel, and so is seen there.
    """
    if on_rays and (predicted.points[:, 2] < 0.0).all():
        forward, reverse = _to_neighbours(predicted, true), _to_neighbours(true, predicted)
    else:
        forward, reverse = _to_where_seen(predicted, true)
    return NearestDistances(
        np.minimum(nearest.forward, forward), np.minimum(nearest.reverse, reverse)
    )


def _squared_to_patches(points: Array, patches: Array, buffers: Array | None = None) -> Array:
    """Return the squared distances (...) of points (3, ...) to patches (7, ...), in a buffer.

    Args:
        buffers: (5, ...), to be written to; by default new ones.
    """
    shape = np.broadcast_shapes(points.shape[1:], patches.shape[1:])
    x, y, z, off, beyond = np.empty((5, *shape)) if buffers is None else buffers
    for axis, apart in enumerate((x, y, z)):
        np.subtract(points[axis], patches[axis], out=apart)
    np.multiply(patches[3], x, out=off)
    off += np.multiply(patches[4], y, out=beyond)
    off += np.multiply(patches[5], z, out=beyond)
    off *= off
    x *= x
    y *= y
    z *= z
    x += y
    x += z
    x -= off
    np.sqrt(np.maximum(x, 0.0, out=x), out=beyond)
    beyond -= patches[6]
    np.maximum(beyond, 0.0, out=beyond)
    beyond *= beyond
    beyond += off
    return np.asarray(beyond)


def _to_neighbours(surface: Surface, other: Surface) -> Array:
    """Return the distance (N,) of each point to the nearest patch of its pixel and the 8 around."""
    height, width = surface.mask.shape
    image, least = surface.patches[:3, 1:-1, 1:-1], np.full((height, width), np.inf)
    tall = max(STRIP // width, 1)
    buffers = np.empty((5, min(tall, height), width))
    for top in range(0, height, tall):
        points, nearest = image[:, top : top + tall], least[top : top + tall]
        for i, j in np.ndindex(3, 3):
            window = other.patches[:, top + i : top + i + len(nearest), j : j + width]
            squared = _squared_to_patches(points, window, buffers[:, : len(nearest)])
            np.minimum(nearest, squared, out=nearest)
    return np.asarray(np.sqrt(least[surface.mask]))


def _to_where_seen(predicted: Surface, true: Surface) -> tuple[Array, Array]:
    """Return the distances (N,) of close pairs both ways, wherever predicted points are seen."""
    mask, points = true.mask, predicted.points
    height, width = mask.shape
    grid, depth = as_lens(true.lens).grid(height, width), -points[:, 2]
    forward, reverse = np.full(len(points), np.inf), np.full((height + 2, width + 2), np.inf)
    with np.errstate(all="ignore"):  # points beside or behind the camera are in no pixel
        column, row = grid.places(points[:, 0], points[:, 1], depth)
    seen = np.flatnonzero(
        (depth > 0.0) & (row >= -1.0) & (row < height + 1.0)
        & (column >= -1.0) & (column < width + 1.0)
    )  # fmt: skip
    row, column = (np.floor(at[seen]).astype(int) + 1 for at in (row, column))
    own = predicted.patches[:, 1:-1, 1:-1][:, mask][:, seen]
    for i, j in np.ndindex(3, 3):
        at = np.clip(row + i - 1, 0, height + 1), np.clip(column + j - 1, 0, width + 1)
        patches = true.patches[:, *at]
        forward[seen] = np.minimum(forward[seen], _squared_to_patches(own, patches))
        np.minimum.at(reverse, at, _squared_to_patches(patches, own))
    return np.sqrt(forward), np.sqrt(reverse[1:-1, 1:-1][mask])
