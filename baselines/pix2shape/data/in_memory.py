"""A file of rooms in memory, as training needs it: images, cameras, and depth if asked for."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from baselines.pix2shape.data.rooms import camera_poses, check_reducible, reduced, room_image
from baselines.pix2shape.network.empty_rooms import Cameras
from scenegen.common.errors import FileFormatError
from scenegen.rooms.reader import RoomsFile


@dataclass(frozen=True, eq=False)
class Rooms:
    """The rows of a file of rooms, N of them.

    Attributes:
        image: linear radiance, (N, 3, S, S), float16.
        world_from_camera: (N, 4, 4).
        scene: number of the scene, (N,).
        angle: of the view, about the vertical axis from the scene's first one, degrees, (N,).
        rounded: whether radiance was stored in 8 bits.
        depth: planar, scene units, (N, S, S), NaN where there is no surface; None if not asked for.
        data, fingerprint: request and fingerprint of the file.
    """

    image: Tensor
    world_from_camera: Tensor
    fov_y_degrees: float
    scene: Tensor
    angle: Tensor
    rounded: bool
    depth: Tensor | None
    data: str
    fingerprint: str

    def __len__(self) -> int:
        return len(self.image)

    def cameras(self, rows: Tensor) -> Cameras:
        """Return the cameras of some rows."""
        return Cameras(self.world_from_camera[rows], self.fov_y_degrees)


def read_rooms(path: str | Path, size: int, *, depth: bool = False) -> Rooms:
    """Read a file of rooms, its images reduced to size x size pixels.

    Raises OSError, FileFormatError as `RoomsFile` and where a camera or an image is not known or,
    if depth is asked for, an image has none; SpecError where images cannot be reduced.
    """
    with RoomsFile(path) as rooms:
        check_reducible(path, rooms.spec.height, rooms.spec.width, size)
        poses = camera_poses(rooms).astype(np.float32)
        images = np.empty((len(rooms), 3, size, size), np.float16)
        depths = np.empty((len(rooms), size, size), np.float32) if depth else None
        for row in range(len(rooms)):
            images[row] = room_image(rooms, row, size)
            if depths is not None:
                depths[row] = reduced(rooms.read("depth", row), size)
                if not np.isfinite(depths[row]).any():
                    raise FileFormatError(f"{path}: depth, row {row}", "no surface", "some")
        scene, angle = (rooms.read(n, slice(None)) for n in ("scene_index", "view_angle_degrees"))
        return Rooms(
            torch.from_numpy(images),
            torch.from_numpy(poses),
            rooms.spec.fov_y_degrees,
            torch.from_numpy(np.asarray(scene)),
            torch.from_numpy(np.asarray(angle)),
            rooms.spec.image_dtype == "uint8",
            None if depths is None else torch.from_numpy(depths),
            rooms.spec.to_json(),
            rooms.fingerprint,
        )
