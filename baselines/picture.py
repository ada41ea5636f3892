"""Masks of objects from a picture alone: what the shading of an empty room does not explain.

Floor and walls are matte and of one colour each, so that the radiance of each is smooth over the
picture: a polynomial of the two coordinates of a wall fits it. Pixels that lie off
the fit show objects. The fit is robust: it begins with all pixels of a wall and goes on with those
that lie near it. Only the picture and the camera are read; where the walls are is known.
"""

import itertools
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from metrics.measures.relief import empty_room
from scenegen.camera import back_project, transform_points

Array = NDArray[Any]

ROUNDS = 12
OFF = 1.5  # standard deviations, estimated by the median absolute deviation
LEAST = 1.5 / 255.0  # of radiance: 8-bit pictures hold no smaller difference
DEGREE = 2
SMALLEST = 12  # pixels of a blob


def outline_mask(
    image: Array, world_from_camera: Array, fov_y_degrees: float, room_size: Array | None = None
) -> Array:
    """Return the pixels that show objects, (H, W) bool.

    Args:
        image: linear radiance, (H, W, 3).
        world_from_camera: (4, 4).
        room_size: of a closed room, (3,); None for the paper's room.
    """
    return residual(image, world_from_camera, fov_y_degrees, room_size)[1]


def residual(
    image: Array, world_from_camera: Array, fov_y_degrees: float, room_size: Array | None = None
) -> tuple[Array, Array]:
    """Return how far each pixel lies off the fitted shading, (H, W, 3), and the mask (H, W)."""
    height, width = image.shape[:2]
    depth, normal = empty_room(world_from_camera, fov_y_degrees, height, width, room_size)
    points = transform_points(world_from_camera, back_project(depth, fov_y_degrees))
    places = points if room_size is None else points / room_size
    facing = normal @ world_from_camera[:3, :3].T
    walls = np.argmax(np.abs(facing), axis=-1)
    off, mask = np.zeros(image.shape), np.zeros(image.shape[:2], bool)
    for axis, far in itertools.product(range(3), (False, True)):
        wall = (walls == axis) & ((facing[..., axis] < 0) == far)
        if np.count_nonzero(wall) < 4 * (DEGREE + 1) ** 2:
            continue
        a, b = (2.0 * places[wall][:, k] - 1.0 for k in range(3) if k != axis)
        basis = np.stack(
            [a**i * b**j for i in range(DEGREE + 1) for j in range(DEGREE + 1 - i)], axis=1
        )
        off[wall], mask[wall] = _off_the_fit(basis, image[wall].astype(np.float64))
    return off, _cleaned(mask)


def _off_the_fit(basis: Array, values: Array) -> tuple[Array, Array]:
    """Return the residuals of colours (N, 3) from a robust fit, and which lie off it, (N,)."""
    kept = np.ones(len(values), bool)
    for _ in range(ROUNDS):
        weights = np.linalg.lstsq(basis[kept], values[kept], rcond=None)[0]
        rest = values - basis @ weights
        distance = np.abs(rest).max(axis=1)
        limit = max(OFF * 1.4826 * float(np.median(distance[kept])), LEAST)
        new = distance <= limit
        if np.array_equal(new, kept) or np.count_nonzero(new) < 2 * basis.shape[1]:
            break
        kept = new
    return rest, ~kept


def _cleaned(mask: Array) -> Array:
    """Return a mask without single pixels, holes and small blobs."""
    smooth = ndimage.median_filter(mask, 3)
    filled = ndimage.binary_fill_holes(smooth)
    blobs, count = ndimage.label(filled)
    pixels = np.bincount(blobs.ravel(), minlength=count + 1)
    return np.asarray(filled & (pixels[blobs] >= SMALLEST))
