"""How many pixels of each cube a view shows, counted without a renderer, 64 pixels at a time.

A cube's outline in the image is convex, so in each row of pixels it covers one run, which is a few
bits of a word. Cubes of one lattice can be painted in the order of their distances from the eye,
summed over the three axes: a ray moves away from the eye along each axis, so that it never meets a
cube before one with a smaller sum. What a cube shows is thus its bits that no cube before it has.
"""

import itertools
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.camera import pixel_size

Array = NDArray[Any]
BITS = 64
VIEWS_AT_ONCE = 256  # of 64x64 pixels: the working arrays stay in cache
_RUNS = np.array([(1 << n) - 1 for n in range(BITS + 1)], np.uint64)  # the first n bits set
_CORNERS = np.array(list(itertools.product((-0.5, 0.5), repeat=3)))


def _outline_edges() -> Array:
    """Return which edges lie on a cube's outline, (3, 2, 2, 3, 3): two of each direction, or none.

    Each is told by its two corners; where there is none, they are the same. The last indices say
    where the eye is along the other two axes: 0 and 2 where it sees the face on the negative or
    positive side, 1 where neither. An edge on the outline is between a face that is seen and one
    that is not.
    """
    edges = np.zeros((3, 2, 2, 3, 3), np.intp)
    for axis, *eye in itertools.product(range(3), *2 * [range(3)]):
        first, second = (4 >> k for k in range(3) if k != axis)
        sides = [
            (i * first + j * second, i * first + j * second + (4 >> axis))
            for i, j in itertools.product((0, 1), repeat=2)
            if (eye[0] == 2 * i) != (eye[1] == 2 * j)
        ]
        for place, ends in enumerate(sides):
            edges[axis, place, :, eye[0], eye[1]] = ends
    return edges


_OUTLINE = _outline_edges()


def cube_pixels(
    size: tuple[int, int],
    fov_y_degrees: float,
    centres: Array,
    counts: Array,
    world_from_shape: Array,
    distances: Array,
) -> NDArray[np.int32]:
    """Return how many pixels show each cube in each of V views, (V, slots); 0 in unused slots.

    These are the pixels whose centre's ray meets the cube first, as rendered ids have them, but for
    rounding where a ray grazes an edge.

    Args:
        size: height and width of the images, pixels.
        centres: centres of the cubes, as `cube_centres` gives them, (V, slots, 3).
        counts: number of cubes of each shape, (V,).
        world_from_shape: rotations, (V, 3, 3).
        distances: from the camera to the origin, (V,), cube edges.
    """
    height, width = size
    at_once = max(1, VIEWS_AT_ONCE * BITS // (height * -(-width // BITS)))
    shown = np.zeros(centres.shape[:2], np.int32)
    for start in range(0, len(centres), at_once):
        part = slice(start, start + at_once)
        shown[part] = _cube_pixels(
            size,
            fov_y_degrees,
            centres[part],
            counts[part],
            world_from_shape[part],
            distances[part],
        )
    return shown


def _cube_pixels(
    size: tuple[int, int], fov_y: float, centres: Array, counts: Array, turns: Array, away: Array
) -> Array:
    """Count as `cube_pixels` does. Arrays of all cubes are (..., slots, V): long inner loops."""
    height, width = size
    views, slots = centres.shape[:2]
    to_eye = (away[:, None] * turns[:, 2])[:, None] - centres
    used = np.arange(slots) < counts[:, None]
    order = np.argsort(np.where(used, np.abs(to_eye).sum(axis=2), np.inf), axis=1)
    to_eye = np.take_along_axis(to_eye, order[..., None], axis=1).transpose(2, 1, 0)
    turned = np.ascontiguousarray(turns.transpose(1, 2, 0))  # (3, 3, V)
    # In the frame of the camera: the middle of each cube, and its corners.
    middle = -(turned[:, :, None] * to_eye).sum(axis=1)
    corner = middle[:, None] + (turned[:, None] * _CORNERS[..., None]).sum(axis=2)[:, :, None]
    per_pixel = 1 / pixel_size(height, fov_y)
    u, v = (
        half + sign * per_pixel * place / corner[2]
        for half, sign, place in ((width / 2, -1, corner[0]), (height / 2, 1, corner[1]))
    )
    top = np.clip(np.ceil(v.min(axis=0) - 0.5), 0, height).astype(np.intp)
    below = np.clip(np.floor(v.max(axis=0) + 0.5), 0, height).astype(np.intp)  # one row further
    below *= np.take_along_axis(used, order, axis=1).T  # unused slots cover no row
    rows = max(0, int((below - top).max()))
    seen = 1 + (to_eye > 0.5) - (to_eye < -0.5)
    others = ((1, 2), (0, 2), (0, 1))
    ends = np.stack([_OUTLINE[k][..., seen[i], seen[j]] for k, (i, j) in enumerate(others)])
    ends = ends.reshape(6, 2, slots, views)
    (u, u_end), (v, v_end) = (
        np.take_along_axis(each, ends.reshape(12, slots, views), axis=0)
        .reshape(ends.shape)
        .swapaxes(0, 1)
        for each in (u, v)
    )
    fall = v_end - v
    slope = np.divide(u_end - u, fall, out=np.zeros_like(u), where=fall != 0)
    middle_u = width / 2 - per_pixel * middle[0] / middle[2]
    middle_v = height / 2 + per_pixel * middle[1] / middle[2]
    on_left = u + (middle_v - v) * slope < middle_u
    at_top = u + (top + 0.5 - v) * slope
    # Each edge of the outline bounds the run of a row on the left or on the right.
    left = np.where((fall != 0) & on_left, at_top, -np.inf).astype(np.float32)
    right = np.where((fall != 0) & ~on_left, at_top, np.inf).astype(np.float32)
    slope = slope.astype(np.float32)
    bounds = np.empty((2, rows, slots, views), np.float32)
    for row in range(rows):
        np.max(left, axis=0, out=bounds[0, row])
        np.min(right, axis=0, out=bounds[1, row])
        left += slope
        right += slope
    left, right = bounds
    tall = np.arange(rows)[:, None, None]
    start = np.clip(np.ceil(left - 0.5), 0, width).astype(np.int16)
    stop = np.clip(np.floor(right + 0.5), start, width).astype(np.int16)
    stop = np.where(tall < below - top, stop, start)
    at = (top + tall) * views + np.arange(views)
    shown = np.zeros((slots, views), np.int32)
    for word in range(0, width, BITS):
        runs = _RUNS[np.clip(stop - word, 0, BITS)] ^ _RUNS[np.clip(start - word, 0, BITS)]
        covered = np.zeros((height + rows) * views, np.uint64)
        for k in range(slots):
            before = covered[at[:, k]]
            covered[at[:, k]] = before | runs[:, k]
            shown[k] += np.bitwise_count(runs[:, k] & ~before).sum(axis=0, dtype=np.int32)
    result = np.zeros((views, slots), np.int32)
    np.put_along_axis(result, order, shown.T, axis=1)
    return result
