"""`depth-supervised`: relief networks that learn from true depth and object ids."""

from functools import partial
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from baselines.pix2shape.network.empty_rooms import empty_rooms
from baselines.relief import predict, training
from baselines.relief.network import Settings
from baselines.relief.training import Lessons
from baselines.training.rooms import Rooms

METHOD = "depth-supervised"
__all__ = ["Settings", "train", "write_submission"]


def lessons_of(rooms: Rooms, settings: Settings, _folder: Path, _progress: Any) -> Lessons:
    """Return the relief that the depth tells, where there is a surface, and the objects.

    The network "sweep" learns to predict each scene's other views, too, if there are any.
    """
    assert rooms.depth is not None, "train asks for it"
    depths = rooms.depth

    def target(rows: Tensor) -> tuple[Tensor, Tensor]:
        poses, depth = rooms.world_from_camera[rows], depths[rows]
        walls, _, _ = empty_rooms(poses, rooms.fov_y_degrees, settings.size)
        surface = depth.isfinite()
        return torch.where(surface, walls - depth, 0), surface.float()

    views = views_of_scenes(rooms) if settings.network == "sweep" else None
    return Lessons(torch.arange(len(rooms)), target, views, rooms.inside)


def views_of_scenes(rooms: Rooms) -> list[Tensor]:
    """Return for each row the rows that show its scene, itself among them."""
    order = torch.argsort(rooms.scene, stable=True)
    counts = torch.unique_consecutive(rooms.scene[order], return_counts=True)[1]
    views: list[Tensor] = [order] * len(rooms)
    for rows in torch.split(order, counts.tolist()):
        for row in rows.tolist():
            views[row] = rows
    return views


train = partial(training.train, METHOD, lessons_of, True)
write_submission = partial(predict.write_submission, METHOD)
