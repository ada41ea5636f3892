"""`solid-supervised`: where rays leave the visible solids, learned from layers.

The network is given what the shortcuts of `solid_iou` are given: true masks, and true depth of the
visible surfaces. It sees no image.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from baselines.pix2shape.network.architecture import RAY_PLANES
from baselines.pix2shape.network.empty_rooms import Cameras, empty_rooms, planes_of
from baselines.relief import training
from baselines.relief.network import Card, Settings, UNet
from baselines.relief.training import FILES, Lessons
from baselines.training.baseline import Baseline, Views
from baselines.training.checkpoint import Method
from baselines.training.images import Array, check_reducible
from baselines.training.rooms import Rooms, camera_poses, read_rooms, room_sizes
from metrics.measures.hidden.solids import entered_spans, round_bodies
from scenegen.camera import pixel_size
from scenegen.common.errors import SpecError
from scenegen.rooms.reader import RoomsFile

NOTES = "given as input: masks, depth of visible surfaces, camera, ground and walls; no image"


class Thickness(UNet):
    """`given_maps` in place of the image -> thickness of solids, edges of the room, (B, S, S)."""

    def __init__(self, card: Card) -> None:
        super().__init__(card.settings, 3 + RAY_PLANES)

    def channels(self, image: Tensor, cameras: Cameras, targets: Cameras) -> Tensor:
        """As `Relief` says."""
        size, edge = image.shape[-1], torch.as_tensor(cameras.edge)
        pose, room = cameras.world_from_camera, cameras.room_size
        walls, _, _ = empty_rooms(pose, cameras.fov_y_degrees, size, room)
        depth, mask, body = image.unbind(dim=1)
        lengths = torch.stack([mask * (walls - depth) / edge, body / edge], dim=1)
        return torch.cat([4 * lengths, mask[:, None], planes_of(targets, size)], dim=1)


def given_maps(depth: Array, object_id: Array, fov_y_degrees: float) -> Array:
    """Return depth and mask of objects, and the thickness of round ones, (3, H, W) float32."""
    mask = object_id > 0
    body = round_bodies(object_id) * pixel_size(len(depth), fov_y_degrees) * depth
    return np.stack([np.where(mask, values, 0) for values in (depth, mask, body)]).astype("f")


def read_solids(files: Sequence[RoomsFile], size: int) -> Rooms:
    """Return rooms with `given_maps` as images, and with thickness as depth.

    Thickness is NaN where no solid is visible. Raises as `read_rooms`, and SpecError for a file
    without layers.
    """
    rooms = read_rooms(files, size)
    given, thickness, inside = [], [], []
    for file in files:
        if "layers/depth" not in file.fields:
            raise SpecError(file.path, "no layers", "rooms of scenegen render --with layers")
        middle = np.s_[file.spec.height // size // 2 :: file.spec.height // size]
        for row in range(len(file)):
            layers, ids, entering = (
                file.read(f"layers/{name}", row)[middle, middle].reshape(size * size, -1).T
                for name in ("depth", "object_id", "entering")
            )
            starts, ends = entered_spans(layers, entering)
            with np.errstate(invalid="ignore"):
                visible = np.where(starts[0] == layers[0], ends[0] - starts[0], np.nan)
            fov = float(file.read("camera/fov_y_degrees", row))
            front = layers[0].reshape(size, size), ids[0].reshape(size, size)
            given.append(torch.from_numpy(given_maps(*front, fov)))
            thickness.append(torch.from_numpy(visible.reshape(size, size)).float())
            inside.append(torch.from_numpy(np.maximum(front[1], 0)))
    image, depth, mask = (torch.stack(each) for each in (given, thickness, inside))
    return replace(rooms, image=image, depth=depth, inside=mask)


def lessons_of(rooms: Rooms, _settings: Settings, _folder: Path | None, _progress: Any) -> Lessons:
    """Return the thickness of solids; all images count the same, as in `solid_iou`."""
    assert rooms.depth is not None, "read_solids has it"
    thickness = rooms.depth

    def target(rows: Tensor) -> tuple[Tensor, Tensor]:
        true = thickness[rows] / training.cameras_of(rooms, rows).edge
        there = true.isfinite()
        true = torch.where(there, true, 0)
        return true, there / true.sum(dim=(1, 2), keepdim=True).clamp(min=1e-3)

    return Lessons(torch.arange(len(rooms)), target, inside=rooms.inside)


def views_of(network: Thickness, card: Card, rooms: RoomsFile) -> Views:
    """Return the layers of every view of a file of rooms.

    A larger image is taken as several of the network's size, each of every second, third, ... row
    and column. Raises SpecError where the ground truth is withheld.
    """
    size = card.settings.size
    check_reducible(rooms.path, rooms.spec.height, rooms.spec.width, size)
    if not rooms.has_truth:
        raise SpecError(rooms.path, "images alone", "a file with ground truth, which is the input")
    poses = torch.from_numpy(camera_poses(rooms, closed=True).astype(np.float32))
    sizes = room_sizes(rooms) if rooms.spec.interior else None
    step = rooms.spec.height // size

    def predicted() -> Iterator[tuple[Array, dict[str, Array]]]:
        for row in range(len(rooms)):
            depth, ids = rooms.read("depth", row), rooms.read("object_id", row)
            fov = float(rooms.read("camera/fov_y_degrees", row))
            cameras = Cameras(poses[row : row + 1], fov, None if sizes is None else sizes[[row]])
            back = np.full_like(depth, np.nan)
            for i, j in np.ndindex(step, step):
                part = np.s_[i::step, j::step]
                given = torch.from_numpy(given_maps(depth[part], ids[part], fov))[None]
                thickness = network(given, cameras, cameras) * cameras.edge
                back[part] = depth[part] + thickness[0].clamp(min=0).numpy()
            back[ids <= 0] = np.nan
            yield np.array([row]), {"layers": np.stack([depth, back], axis=-1)[None]}

    return Views(predicted(), "scored_view", notes=NOTES)


BASELINE = Baseline(
    Method("solid-supervised", Card, Thickness),
    Settings,
    FILES,
    partial(training.lesson, lessons_of, read=read_solids, shape=False),
    views=views_of,
)
