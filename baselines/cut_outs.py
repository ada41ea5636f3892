"""Rooms without 3D: floors that a method has to beat before it can be said to see shapes.

All know where floor and walls are, as `empty-room` does.

- cut-out: each object as its true mask, flat, at its true median depth. It is told the truth, and
  what it lacks is shape.
- picture-outline: the mask of `outline_mask`, lifted by one constant.
- outline-regression, outline-relief: that mask, lifted by what a linear regression or
  gradient-boosted trees make of features of the outline; both learn from the depth of other rooms.
- balls: each blob of the mask in a scene's first view as a ball, drawn in all its views.
- nearest: the relief of that training image whose picture is left over from the fitted shading of
  the walls most alike.

A mask is what the shading of an empty room does not explain. Floor and walls are matte and of one
colour each, so that the radiance of each is smooth over the picture: a polynomial of the two
coordinates of a wall fits it. Pixels that lie off the fit show objects. The fit is robust: it
begins with all pixels of a wall and goes on with those that lie near it.
"""

import itertools
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from metrics.measures.relief import empty_room
from scenegen.camera import Lens, back_project, pixel_directions, pixel_size, transform_points
from scenegen.common.threads import one_thread
from scenegen.rooms.reader import RoomsFile, radiance_of

Array = NDArray[Any]

ROUNDS = 12
OFF = 1.5  # standard deviations, estimated by the median absolute deviation
LEAST = 1.5 / 255.0  # of radiance: 8-bit pictures hold no smaller difference
DEGREE = 2
SMALLEST = 12  # pixels of a blob
DepthOf = Callable[[RoomsFile, int], Array]  # planar depth (H, W) of a row
LEARNING = ("outline-regression", "outline-relief", "nearest")
# Scene units: between the median (0.166) and the mean (0.182) of the relief of objects in images of
# `--preset shapes --views 0,5,35,55,80 --n 300 --seed 7 --size 64`.
LIFT = 0.17
MOST_IMAGES = 1500  # of training rooms, spread evenly
CELLS = 16  # a side, of the pictures that `nearest` compares


def outline_mask(
    image: Array, world_from_camera: Array, lens: Lens | float, room_size: Array | None = None
) -> Array:
    """Return the pixels that show objects, (H, W) bool.

    Args:
        image: linear radiance, (H, W, 3).
        world_from_camera: (4, 4).
        room_size: of a closed room, (3,); None for the paper's room.
    """
    return residual(image, world_from_camera, lens, room_size)[1]


def residual(
    image: Array, world_from_camera: Array, lens: Lens | float, room_size: Array | None = None
) -> tuple[Array, Array]:
    """Return how far each pixel lies off the fitted shading, (H, W, 3), and the mask (H, W)."""
    height, width = image.shape[:2]
    depth, normal = empty_room(world_from_camera, lens, height, width, room_size)
    points = transform_points(world_from_camera, back_project(depth, lens))
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


def _camera(rooms: RoomsFile, row: int) -> tuple[Array, Lens]:
    """Return world_from_camera and the lens of a row."""
    return rooms.read("camera/world_from_camera", row), rooms.lens(row)


def empty(rooms: RoomsFile, row: int) -> tuple[Array, Array]:
    """Return depth and normals of the room of a row without its objects."""
    size = rooms.spec.height, rooms.spec.width
    return empty_room(*_camera(rooms, row), *size, rooms.room_size(row))


def _empty(rooms: RoomsFile, row: int) -> Array:
    return empty(rooms, row)[0]


def _mask(rooms: RoomsFile, row: int) -> Array:
    return outline_mask(radiance_of(rooms, row), *_camera(rooms, row), rooms.room_size(row))


def cut_out(rooms: RoomsFile, row: int) -> Array:
    """Return the depth of true masks, each flat at its object's median depth."""
    depth, truth = _empty(rooms, row), rooms.read("depth", row)
    ids = rooms.read("object_id", row)
    for number in np.unique(ids[ids > 0]).tolist():
        depth[ids == number] = np.median(truth[ids == number])
    return depth


def picture_outline(rooms: RoomsFile, row: int) -> Array:
    """Return the empty room with the picture's mask lifted by LIFT."""
    return np.asarray(_empty(rooms, row) - LIFT * _mask(rooms, row))


def balls(rooms: RoomsFile, row: int) -> Array:
    """Return the depth of balls at the blobs of the scene's first view, seen in this one."""
    scene, view = rooms.read("scene_index", row), rooms.read("view_index", row)
    source = row
    if view:
        scenes, views = (rooms.read(n, slice(None)) for n in ("scene_index", "view_index"))
        first = np.flatnonzero((scenes == scene) & (views == 0))
        source = int(first[0]) if len(first) else row
    matrix, lens = _camera(rooms, source)
    found = blob_balls(_mask(rooms, source), _empty(rooms, source), lens)
    centres = transform_points(matrix, found[:, :3])
    matrix, lens = _camera(rooms, row)
    depth = _empty(rooms, row)
    rays = pixel_directions(depth.shape[0], depth.shape[1], lens)
    for centre, radius in zip((centres - matrix[:3, 3]) @ matrix[:3, :3], found[:, 3], strict=True):
        square, along = (rays * rays).sum(axis=-1), rays @ centre
        inside = along * along - square * (centre @ centre - radius * radius)
        hit = (along - np.sqrt(np.maximum(inside, 0.0))) / square
        depth = np.where((inside > 0.0) & (hit > 0.0), np.minimum(depth, hit), depth)
    return depth


def blob_balls(mask: Array, empty: Array, lens: Lens | float) -> Array:
    """Return a ball for each blob of a mask: centre, camera frame, and radius, (K, 4).

    A ball takes as many pixels as its blob. Its surface stands before the empty room by LIFT on
    average, which puts the centre by two thirds of its radius behind that.
    """
    blobs, count = ndimage.label(mask)
    rays = pixel_directions(mask.shape[0], mask.shape[1], lens)
    pitch = pixel_size(mask.shape[0], lens)
    found = np.empty((count, 4))
    for k in range(count):
        own = blobs == k + 1
        slope = np.sqrt(np.count_nonzero(own) / np.pi) * pitch  # radius / depth of the centre
        depth = (float(empty[own].mean()) - LIFT) / (1.0 - slope * 2.0 / 3.0)
        found[k] = *(rays[own].mean(axis=0) * depth), slope * depth
    return found


WITHOUT_TRAINING: dict[str, DepthOf] = {
    "cut-out": cut_out,
    "picture-outline": picture_outline,
    "balls": balls,
}


def learned(name: str, training: RoomsFile) -> DepthOf:
    """Return what a baseline of LEARNING predicts after it has seen training rooms."""
    count = min(len(training), MOST_IMAGES)
    rows = np.unique(np.linspace(0, len(training) - 1, count).astype(int))
    if name == "nearest":
        return partial(_nearest, *_pictures(training, rows))
    seen = [_outline_pixels(training, row) for row in rows.tolist()]
    features = np.concatenate([features for _, features, _ in seen])
    relief = np.concatenate([relief[mask] for mask, _, relief in seen])
    known = np.isfinite(relief)
    lift_of = _regression if name == "outline-regression" else _trees
    return partial(_lifted, lift_of(features[known], relief[known]))


def _outline_pixels(rooms: RoomsFile, row: int) -> tuple[Array, Array, Array]:
    """Return the mask of a picture, the features of its pixels, and the true relief (H, W)."""
    mask, empty = _mask(rooms, row), _empty(rooms, row)
    return mask, outline_features(mask, empty), empty - rooms.read("depth", row)


def _lifted(lift: Callable[[Array], Array], rooms: RoomsFile, row: int) -> Array:
    mask, depth = _mask(rooms, row), _empty(rooms, row)
    if mask.any():
        depth[mask] -= np.maximum(lift(outline_features(mask, depth)), 0.0)
    return depth


def outline_features(mask: Array, empty: Array) -> Array:
    """Return 12 features of each pixel of a mask, (N, 12); lengths are shares of the height.

    Root of the blob's area, its height and width, distance to its edge, the same as a share of the
    largest one in the blob, place in its box (sideways from the middle, and from the top), pixels
    below in the blob, and depth of the empty room there, at the blob's mean and at its foot; and
    the place of the pixel in the picture from the top.
    """
    height = mask.shape[0]
    blobs, count = ndimage.label(mask)
    edge = ndimage.distance_transform_edt(mask) / height
    features = np.zeros((*mask.shape, 12))
    rows, columns = np.mgrid[: mask.shape[0], : mask.shape[1]] / height
    for k in range(1, count + 1):
        own = blobs == k
        y, x = rows[own], columns[own]
        foot = y == y.max()
        below = own[::-1].cumsum(axis=0)[::-1][own] / height
        tall, wide = np.ptp(y) + 1.0 / height, np.ptp(x) + 1.0 / height
        features[own] = np.stack(
            np.broadcast_arrays(
                np.sqrt(np.count_nonzero(own)) / height, tall, wide,
                edge[own], edge[own] / edge[own].max(),
                np.abs(x - x.min() - wide / 2.0) / wide, (y - y.min()) / tall, below,
                empty[own], empty[own].mean(), empty[own][foot].mean(), y,
            ),
            axis=1,
        )  # fmt: skip
    return features[mask]


def _regression(features: Array, relief: Array) -> Callable[[Array], Array]:
    """Return the linear least-squares fit of relief to features and their squares."""
    middle, spread = features.mean(axis=0), features.std(axis=0) + 1e-9

    def columns(values: Array) -> Array:
        scaled = (values - middle) / spread
        return np.concatenate([np.ones((len(values), 1)), scaled, scaled**2], axis=1)

    matrix = columns(features)
    ridge = 1e-6 * len(matrix) * np.eye(matrix.shape[1])
    weights = np.linalg.solve(matrix.T @ matrix + ridge, matrix.T @ relief)
    return lambda values: np.asarray(columns(values) @ weights)


def _trees(features: Array, relief: Array) -> Callable[[Array], Array]:
    """Return what gradient-boosted trees make of features, learned with absolute errors."""
    from sklearn.ensemble import HistGradientBoostingRegressor

    trees = HistGradientBoostingRegressor(
        loss="absolute_error", max_iter=100, learning_rate=0.2, early_stopping=False, random_state=0
    )

    def lift(values: Array) -> Array:
        with one_thread():  # OpenMP came with scikit-learn just now
            return np.asarray(trees.predict(values))

    with one_thread():  # sums then have one order
        trees.fit(features[::8], relief[::8])
    return lift


def _left_over(rooms: RoomsFile, row: int) -> Array:
    """Return the size of the picture's residual, reduced to CELLS x CELLS, as a vector."""
    off, mask = residual(radiance_of(rooms, row), *_camera(rooms, row), rooms.room_size(row))
    size = np.linalg.norm(off, axis=-1) * mask
    rows, columns = (np.linspace(0, n, CELLS + 1).astype(int)[:-1] for n in size.shape)
    sums = np.add.reduceat(np.add.reduceat(size, rows, axis=0), columns, axis=1)
    return np.asarray(sums.ravel())


def _pictures(training: RoomsFile, rows: Array) -> tuple[Array, Array]:
    """Return what is left over of training pictures, (N, CELLS^2), and their relief (N, H, W)."""
    keys = np.stack([_left_over(training, row) for row in rows.tolist()])
    relief = [_empty(training, row) - training.read("depth", row) for row in rows.tolist()]
    return keys, np.nan_to_num(np.stack(relief).astype(np.float32))


def _nearest(keys: Array, relief: Array, rooms: RoomsFile, row: int) -> Array:
    apart = np.square(keys - _left_over(rooms, row)).sum(axis=1)
    return np.asarray(_empty(rooms, row) - relief[int(apart.argmin())])
