"""A view as all layouts are read: maps and a camera, in one frame."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]


@dataclass(frozen=True, eq=False)
class View:
    """One image with what a folder tells of it; None for what it does not tell.

    The camera frame is x right, y down, z forward, and the centre of the first pixel is (0.5, 0.5).

    Attributes:
        matrix: the camera matrix, (3, 3), pixels.
        depth: planar, (H, W), NaN where it is not known.
        normal: unit, (H, W, 3), NaN where it is not known.
        image: (H, W, 3) uint8.
        world_from_camera: (4, 4).
        points, pixels: world points that are observed, (N, 3), and where, (N, 2).
    """

    matrix: Array
    depth: Array | None = None
    normal: Array | None = None
    image: Array | None = None
    world_from_camera: Array | None = None
    points: Array | None = None
    pixels: Array | None = None

    def rays(self, x: Array, y: Array) -> Array:
        """Return the directions of pixels, with z = 1, (..., 3)."""
        (fx, _, cx), (_, fy, cy), _ = self.matrix
        return np.stack([(x - cx) / fx, (y - cy) / fy, np.ones(np.broadcast(x, y).shape)], axis=-1)

    def stretch(self) -> Array:
        """Return distance along the ray over planar depth, (H, W)."""
        assert self.depth is not None
        rows, columns = np.indices(self.depth.shape) + 0.5
        return np.asarray(np.linalg.norm(self.rays(columns, rows), axis=-1))

    def project(self, points: Array) -> tuple[Array, Array, Array]:
        """Return x and y, in pixels, and planar depth of world points, (N, 3)."""
        assert self.world_from_camera is not None
        pose = np.linalg.inv(self.world_from_camera)
        x, y, z = pose[:3, :3] @ points.T + pose[:3, 3:]
        (fx, _, cx), (_, fy, cy), _ = self.matrix
        ahead = np.where(z > 0, z, np.nan)
        return cx + fx * x / ahead, cy + fy * y / ahead, ahead


Load = Callable[[], View]  # reads a view
