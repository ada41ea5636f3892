"""Samples of predicted images beside their truth, at which hints look."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from metrics.measured.reader import Images, MeasuredFile, is_flat
from metrics.submissions.reader import RoomPredictions
from metrics.submissions.rules import LARGEST
from scenegen.camera import pixel_directions, pixel_size
from scenegen.common.errors import FileFormatError

Array = NDArray[Any]
ROWS = 24
FEWEST_PIXELS = 20  # of measured depth in an image
SIDE = 32  # pixels per side that hints look at, at most twice as many
SPARSE_SIDE = 256  # the same, where depth is known at few pixels


@dataclass(frozen=True, eq=False)
class Sample:
    """Predicted and true pixels of one image, on a grid that is its own mirror image.

    Attributes:
        depth: predicted planar depth, (h, w), or disparity.
        true_depth: scene units, (h, w).
        mask: where both are finite, (h, w).
        rays: directions of the pixels, (h, w, 3), with z = -1.
        pitch: the pixel size of the whole image on the plane at depth 1.
        points: predicted, camera frame, (h, w, 3); None where depth is predicted.
        normal: predicted, (h, w, 3); None where there are none.
        true_normal: camera frame, (h, w, 3).
        camera_from_world: rotation, (3, 3).
        position: of the camera, world, (3,).
        fov_y_degrees: vertical field of view.
    """

    depth: Array
    true_depth: Array
    mask: Array
    rays: Array
    pitch: float
    points: Array | None
    normal: Array | None
    true_normal: Array
    camera_from_world: Array
    position: Array
    fov_y_degrees: float

    @property
    def stretch(self) -> Array:
        """Length of the ray at depth 1: distance along the ray is depth times this, (h, w)."""
        return np.asarray(np.linalg.norm(self.rays, axis=-1))

    @property
    def true_points(self) -> Array:
        """Camera frame, scene units, (N, 3), of the mask."""
        return np.asarray((self.rays * self.true_depth[..., None])[self.mask])


def sample_rooms(predictions: RoomPredictions, truth: Images) -> list[Sample]:
    """Return the usable ones of some rows that are spread evenly over a submission."""
    entries = np.flatnonzero((predictions.rows >= 0) & (predictions.rows < len(truth)))
    if len(entries) == 0 or not is_flat(truth):
        return []
    spread = np.linspace(0, len(entries) - 1, ROWS).astype(np.int64)
    samples = (_sample(predictions, int(i), truth) for i in entries[np.unique(spread)])
    return [sample for sample in samples if sample is not None]


def mirrored_grid(count: int, about: int) -> Array:
    """Return `about` to twice as many indices, spread over range(count) and symmetric in it."""
    if count <= 2 * about:
        return np.arange(count)
    first = np.floor(np.linspace(0, count - 1, about)).astype(np.int64)
    return np.unique(np.concatenate([first, count - 1 - first]))


def _sample(predictions: RoomPredictions, i: int, truth: Images) -> Sample | None:
    row = int(predictions.rows[i])
    try:
        disparity = predictions.kind == "disparity"
        depth = predictions.geometry(i) if disparity else predictions.depth(i)
        normal = predictions.normal(i) if predictions.has_normals else None
    except FileFormatError:
        return None
    if isinstance(truth, MeasuredFile):
        return _measured_sample(depth, truth, row)
    height, width = depth.shape
    grid = np.ix_(mirrored_grid(height, SIDE), mirrored_grid(width, SIDE))
    lens = truth.lens(row)
    true_depth = truth.read("depth", row)[grid].astype(np.float64)
    pose = truth.read("camera/world_from_camera", row)
    usable = np.isfinite(true_depth) & (np.abs(depth[grid]) <= LARGEST)
    points = predictions.geometry(i)[grid] if predictions.kind == "points" else None
    if points is not None:
        usable &= (np.abs(points) <= LARGEST).all(axis=-1)
    if 2 * np.count_nonzero(usable) < usable.size:
        return None
    return Sample(
        depth[grid],
        true_depth,
        usable,
        pixel_directions(height, width, lens)[grid],
        pixel_size(height, lens),
        points,
        None if normal is None else normal[grid],
        truth.read("normal", row)[grid].astype(np.float64),
        pose[:3, :3].T,
        pose[:3, 3],
        lens.fov_y_degrees,
    )


def _measured_sample(depth: Array, truth: MeasuredFile, row: int) -> Sample | None:
    """Return a sample of an image whose truth may be sparse, so that more pixels are looked at."""
    height, width = truth.size(row)
    side = SIDE if truth.dense else SPARSE_SIDE
    grid = np.ix_(mirrored_grid(height, side), mirrored_grid(width, side))
    depth, true = depth[:height, :width][grid], truth.read("depth", row)[:height, :width][grid]
    usable = np.isfinite(true) & (np.abs(depth) <= LARGEST)
    if np.count_nonzero(usable) < FEWEST_PIXELS:
        return None
    rays, no = truth.rays(row, height, width), np.broadcast_to(np.nan, (*usable.shape, 3))
    # Without a camera, rays are those of no field of view: a distance along them is the depth.
    rays = np.broadcast_to((0.0, 0.0, -1.0), no.shape) if rays is None else rays[grid]
    return Sample(
        depth, true.astype(np.float64), usable, rays, 0.0, None, None, no, np.eye(3), np.zeros(3),
        np.nan,
    )  # fmt: skip
