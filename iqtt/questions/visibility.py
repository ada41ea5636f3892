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
# The twelve edges: two corners, and the two faces (axis, whether on its positive side) that meet.
_EDGES = [
    (i, j, [(axis, bool(_CORNERS[i, axis] > 0)) for axis in range(3) if i ^ j != 4 >> axis])
    for i, j in itertools.combinations(range(8), 2)
    if (i ^ j) in (1, 2, 4)
]


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
        centres, counts, world_from_shape, distances: as for `packing.pack_views`.
    """
    height, width = size
    at_once = max(1, VIEWS_AT_ONCE * BITS // (height * -(-width // BITS)))
    shown = np.zeros(centres.shape[:2], np.int32)
    for start in range(0, len(centres), at_once):
        some = slice(start, start + at_once)
        shown[some] = _cube_pixels(
            size, fov_y_degrees, centres[some], counts[some], world_from_shape[some], distances[some]
        )
    return shown


def _cube_pixels(
    size: tuple[int, int], fov_y: float, centres: Array, counts: Array, turns: Array, away: Array
) -> Array:
    """Count as `cube_pixels` does. Arrays of all cubes are (..., slots, V), for long inner loops."""
    height, width = size
    views, slots = centres.shape[:2]
    to_eye = (away[:, None] * turns[:, 2])[:, None] - centres
    used = np.arange(slots) < counts[:, None]
    order = np.argsort(np.where(used, np.abs(to_eye).sum(axis=2), np.inf), axis=1)
    to_eye = np.take_along_axis(to_eye, order[..., None], axis=1).transpose(2, 1, 0)
    faces = {(axis, side): (to_eye[axis] if side else -to_eye[axis]) > 0.5
             for axis in range(3) for side in (False, True)}  # those that face the eye
    turned = np.ascontiguousarray(turns.transpose(1, 2, 0))  # (3, 3, V)
    # In the frame of the camera: the middle of each cube, and its corners.
    middle = -(turned[:, :, None] * to_eye).sum(axis=1)
    corner = middle[:, None] + np.einsum("ijv,cj->icv", turned, _CORNERS)[:, :, None]
    per_pixel = 1 / pixel_size(height, fov_y)
    u, v = (half + sign * per_pixel * place / corner[2]
            for half, sign, place in ((width / 2, -1, corner[0]), (height / 2, 1, corner[1])))
    top = np.clip(np.ceil(v.min(axis=0) - 0.5), 0, height).astype(np.intp)
    below = np.clip(np.floor(v.max(axis=0) + 0.5), 0, height).astype(np.intp)  # one row further
    below[order.T >= counts] = 0  # unused slots
    tall = np.arange(max(0, int((below - top).max())))[:, None, None]
    # Each edge of the outline bounds the run of a row on the left or on the right.
    left = np.full((len(tall), slots, views), -np.inf, np.float32)
    right = -left
    middle_u = width / 2 - per_pixel * middle[0] / middle[2]
    middle_v = height / 2 + per_pixel * middle[1] / middle[2]
    for i, j, (one, other) in _EDGES:
        fall = v[j] - v[i]
        outline = (faces[one] != faces[other]) & (fall != 0)
        slope = (u[j] - u[i]) / np.where(outline, fall, 1)
        at_top = u[i] + (top + 0.5 - v[i]) * slope
        on_left = u[i] + (middle_v - v[i]) * slope < middle_u
        for bound, sharper, bounds, none in (
            (left, np.maximum, outline & on_left, -np.inf),
            (right, np.minimum, outline & ~on_left, np.inf),
        ):
            first = np.where(bounds, at_top, none).astype(np.float32)
            line = np.where(bounds, slope, 0).astype(np.float32) * tall.astype(np.float32)
            line += first
            sharper(bound, line, out=bound)
    start = np.clip(np.ceil(left - 0.5), 0, width).astype(np.int16)
    stop = np.clip(np.floor(right + 0.5), start, width).astype(np.int16)
    stop = np.where(tall < below - top, stop, start)
    at = (top + tall) * views + np.arange(views)
    shown = np.zeros((slots, views), np.int32)
    for word in range(0, width, BITS):
        runs = _RUNS[np.clip(stop - word, 0, BITS)] ^ _RUNS[np.clip(start - word, 0, BITS)]
        covered = np.zeros((height + len(tall)) * views, np.uint64)
        for k in range(slots):
            before = covered[at[:, k]]
            covered[at[:, k]] = before | runs[:, k]
            shown[k] += np.bitwise_count(runs[:, k] & ~before).sum(axis=0, dtype=np.int32)
    found = np.zeros((views, slots), np.int32)
    np.put_along_axis(found, order, shown.T, axis=1)
    return found
