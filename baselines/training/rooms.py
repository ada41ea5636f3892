"""Images and cameras of rooms, read from an open file and checked."""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
import torch
from torch import Tensor

from baselines.training.images import Array, channels_first, check_reducible, reduced
from metrics.measures.shape import inside_objects
from scenegen.common.errors import FileFormatError, SpecError
from scenegen.rooms.reader import RoomsFile, radiance_of

FARTHEST = 1e4  # scene units; a camera farther away sees the whole room in less than a pixel
WIDEST = 179.0  # degrees of a field of view
UPRIGHT = 1e-3  # of products of a pose's axes, by which they may differ from those of a rotation


@dataclass(frozen=True, eq=False)
class Rooms:
    """The rows of one file of rooms or several in memory, N of them.

    Attributes:
        image: linear radiance, (N, 3, S, S), float16.
        world_from_camera: (N, 4, 4).
        fov_y_degrees: vertical angle of view: a number for all rows, or (N,) where they differ.
        room_size: as `room_sizes`, (N, 3).
        scene: number of the scene, (N,); scenes of different files have different ones.
        angle: of the view, about the vertical axis from the scene's first one, degrees, (N,).
        rounded: whether radiance was stored in 8 bits.
        depth: planar, scene units, (N, S, S), NaN where there is no surface; None if not asked for.
        inside: the object that each pixel lies inside, (N, S, S) int32, as `shape.inside_objects`;
            0 at other pixels. None if depth is not asked for.
        fingerprint: of the files.
    """

    image: Tensor
    world_from_camera: Tensor
    fov_y_degrees: float | Tensor
    room_size: Tensor
    scene: Tensor
    angle: Tensor
    rounded: bool
    depth: Tensor | None
    inside: Tensor | None
    fingerprint: str

    def __len__(self) -> int:
        return len(self.image)

    def fov_of(self, rows: Tensor | Sequence[int]) -> float | Tensor:
        """Return the angle of view of rows, a number for all or (B,)."""
        fov = self.fov_y_degrees
        return fov[rows] if isinstance(fov, Tensor) else fov


def read_rooms(files: Sequence[RoomsFile], size: int, *, depth: bool = False) -> Rooms:
    """Read all rooms of files, their images reduced to size x size pixels.

    Args:
        depth: whether depth and object ids are read, too.

    Raises FileFormatError where a camera or an image is not known or, if depth is asked for, an
    image has none; SpecError where images cannot be reduced.
    """
    parts, scenes = [], 0
    for file in files:
        part = _read_file(file, size, depth)
        parts.append(replace(part, scene=part.scene + scenes))
        scenes += int(part.scene.max()) + 1 if len(part) else 0
    names = [f.name for f in fields(Rooms) if isinstance(getattr(parts[0], f.name), Tensor)]
    together: dict[str, Any] = {
        name: torch.cat([getattr(part, name) for part in parts]) for name in names
    }
    fov = together.pop("fov_y_degrees")
    return replace(
        parts[0],
        **together,
        fov_y_degrees=float(fov[0]) if len(fov.unique()) == 1 else fov.float(),
        rounded=any(part.rounded for part in parts),
        fingerprint=" ".join(part.fingerprint for part in parts),
    )


def _read_file(rooms: RoomsFile, size: int, depth: bool) -> Rooms:
    check_reducible(rooms.path, rooms.spec.height, rooms.spec.width, size)
    poses = camera_poses(rooms, closed=True).astype(np.float32)
    images = np.empty((len(rooms), 3, size, size), np.float16)
    depths = np.empty((len(rooms), size, size), np.float32) if depth else None
    inside = np.empty((len(rooms), size, size), np.int32) if depth else None
    for row in range(len(rooms)):
        images[row] = room_image(rooms, row, size)
        if depths is not None and inside is not None:
            inside[row] = inside_objects(_alone(rooms.read("object_id", row), size))
            depths[row] = reduced(rooms.read("depth", row), size)
            if not np.isfinite(depths[row]).any():
                raise FileFormatError(
                    f"{rooms.path}: depth, row {row}",
                    "no surface",
                    "at least one pixel with a surface",
                )
    scene, angle = (rooms.read(n, slice(None)) for n in ("scene_index", "view_angle_degrees"))
    return Rooms(
        torch.from_numpy(images),
        torch.from_numpy(poses),
        torch.from_numpy(bounded(rooms, "camera/fov_y_degrees", WIDEST)),
        room_sizes(rooms),
        torch.from_numpy(np.asarray(scene)),
        torch.from_numpy(np.asarray(angle)),
        rooms.spec.image_dtype == "uint8",
        None if depths is None else torch.from_numpy(depths),
        None if inside is None else torch.from_numpy(inside),
        rooms.fingerprint,
    )


def _alone(object_id: Array, size: int) -> Array:
    """Return the ids of the square blocks that show one object alone, (S, S), else 0."""
    block = object_id.shape[0] // size
    blocks = object_id.reshape(size, block, size, block)
    least, most = blocks.min(axis=(1, 3)), blocks.max(axis=(1, 3))
    return np.where(least == most, most, 0)


def room_image(rooms: RoomsFile, row: int, size: int) -> Array:
    """Return the image of a row as the networks take it, (3, S, S). Raises as `channels_first`."""
    where = f"{rooms.path}: image, row {row}"
    return channels_first(radiance_of(rooms, row), size, where)


def room_images(rooms: RoomsFile, rows: Array, size: int) -> Tensor:
    """Return the images of rows as the networks take them, (B, 3, S, S). Raises as `room_image`."""
    return torch.from_numpy(np.stack([room_image(rooms, int(row), size) for row in rows]))


def room_sizes(rooms: RoomsFile) -> Tensor:
    """Return the inner size of the closed room of each row, metres, (N, 3) float32.

    The paper's room is infinite, as it is open. Raises FileFormatError where a size is not known.
    """
    if not rooms.spec.interior:
        return torch.full((len(rooms), 3), torch.inf)
    return torch.from_numpy(bounded(rooms, "room/size", FARTHEST).astype(np.float32))


def camera_poses(rooms: RoomsFile, *, closed: bool = False) -> Array:
    """Return world_from_camera of all rows, (N, 4, 4).

    Args:
        closed: whether the method takes closed rooms, too.

    Raises FileFormatError where one is unknown, far away, or no rotation and translation, and
    SpecError for closed rooms, and as `RoomSpec.check_centred`.
    """
    rooms.spec.check_centred(rooms.path)
    if rooms.spec.interior and not closed:
        expected = "the paper's rooms, for which this method was made"
        raise SpecError(rooms.path, "closed rooms in metres", expected)
    name = "camera/world_from_camera"
    poses = bounded(rooms, name, FARTHEST)
    turns = poses[:, :3, :3].astype(float)
    off: Array = np.abs(turns.transpose(0, 2, 1) @ turns - np.eye(3)).max(axis=(1, 2))
    mirrored, last = np.linalg.det(turns) < 0, (poses[:, 3] != (0, 0, 0, 1)).any(axis=1)
    message = "a matrix that is no rotation and translation"
    refuse_rows(rooms, name, (off > UPRIGHT) | mirrored | last, message, "a camera's pose")
    return poses


def bounded(rooms: RoomsFile, name: str, most: float) -> Array:
    """Return what the networks are told of all rows. Raises FileFormatError beyond +-`most`."""
    values: Array = rooms.read(name, slice(None))
    fine = np.abs(values.reshape(len(values), -1)) <= most  # NaN is not
    expected = f"finite numbers of at most {most:g}, because the networks take them as input"
    refuse_rows(rooms, name, ~fine.all(axis=1), "numbers that are not finite, or huge", expected)
    return values


def refuse_rows(rooms: RoomsFile, name: str, wrong: Any, message: str, expected: str) -> None:
    """Raise FileFormatError for the first of the rows that are wrong, (N,), if any is."""
    if wrong.any():
        where = f"{rooms.path}: {name}, row {np.flatnonzero(wrong)[0]}"
        hint = "render the file anew with `scenegen render`, or leave this row out"
        raise FileFormatError(where, message, expected, hint)


def input_views(rooms: RoomsFile) -> tuple[Array, Array]:
    """Return each scene's input row, (S,), and for each row its scene's place in there, (N,)."""
    scene, view = (rooms.read(name, slice(None)) for name in ("scene_index", "view_index"))
    first: dict[int, int] = {}
    for row in np.argsort(view, kind="stable"):
        first.setdefault(int(scene[row]), int(row))
    inputs = np.array(sorted(first.values()))
    if late := np.count_nonzero(view[inputs]):
        warnings.warn(
            f"{rooms.path}: {late} of {len(inputs)} scenes have no view 0; the model's input is the"
            " first of their other views",
            stacklevel=3,
        )
    return inputs, np.searchsorted(inputs, [first[int(number)] for number in scene])
