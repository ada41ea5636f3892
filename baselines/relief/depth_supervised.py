"""`depth-supervised`: a relief network that learns from true depth and object ids."""

from functools import partial
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from baselines.pix2shape.network.empty_rooms import empty_rooms
from baselines.relief import training
from baselines.relief.network import Card, Settings, relief_network
from baselines.relief.training import FILES, Lessons, views_of
from baselines.training.baseline import Baseline
from baselines.training.checkpoint import Method
from baselines.training.rooms import Rooms

METHOD = Method("depth-supervised", Card, relief_network)
TOLD = "; in training, true depth and object ids"


def lessons_of(rooms: Rooms, settings: Settings, _folder: Path, _progress: Any) -> Lessons:
    """Return the relief that the depth tells, where there is a surface, and the objects."""
    assert rooms.depth is not None, "train asks for it"
    depths = rooms.depth

    def target(rows: Tensor) -> tuple[Tensor, Tensor]:
        cameras, depth = training.cameras_of(rooms, rows), depths[rows]
        pose, sizes = cameras.world_from_camera, cameras.room_size
        walls, _, _ = empty_rooms(pose, cameras.fov_y_degrees, settings.size, sizes)
        surface = depth.isfinite()
        return torch.where(surface, (walls - depth) / cameras.edge, 0), surface.float()

    return Lessons(torch.arange(len(rooms)), target, inside=rooms.inside)


BASELINE = Baseline(
    METHOD,
    Settings,
    FILES,
    partial(training.lesson, lessons_of, with_depth=True),
    views=partial(views_of, TOLD),
)
