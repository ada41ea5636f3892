"""`depth-completed`: what the first view sees, completed for other cameras, from true depth.

A trained network of `depth-supervised` gives the surface that the first view sees, and stays as it
is. A second one learns what another camera sees, of rays through that surface.
"""

from functools import partial
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from baselines.pix2shape.matching import STEPS, paper_rooms_only, reliefs, reprojected
from baselines.pix2shape.network.architecture import RAY_PLANES
from baselines.pix2shape.network.empty_rooms import NEAREST, Cameras, empty_rooms, planes_of
from baselines.relief import depth_supervised, training
from baselines.relief.network import Card, Relief, Settings, UNet, predicted_depth
from baselines.relief.training import FILES, Lessons, views_of
from baselines.training.baseline import Baseline, Lesson, Run
from baselines.training.checkpoint import Method, bundled
from baselines.training.rooms import Rooms

THICK = 0.2  # scene units; how far before or behind a surface is told, at most


class Completion(Relief):
    """A unet that gives the input's own surface, and one that completes it for other cameras.

    The second one is told of each ray how far the points at a list of reliefs lie behind the first
    one's surface, as the input's camera sees them. Below 0 is empty space, and what lies behind an
    object may be part of it.
    """

    from_first_view = True

    def __init__(self, card: Card) -> None:
        super().__init__()
        self.seen = UNet(card.settings).requires_grad_(False)
        self.completed = UNet(card.settings, STEPS + RAY_PLANES)

    def train(self, mode: bool = True) -> "Completion":
        """As `nn.Module.train`; the first network stays as it is."""
        super().train(mode)
        self.seen.eval()
        return self

    def channels(self, image: Tensor, cameras: Cameras, targets: Cameras) -> Tensor:
        """As `Relief` says."""
        paper_rooms_only(targets.room_size)
        size = image.shape[-1]
        with torch.no_grad():
            surface = predicted_depth(self.seen, image, cameras, cameras)
        walls = empty_rooms(targets.world_from_camera, targets.fov_y_degrees, size)[0][:, None]
        depth = (walls - reliefs(walls)[:, None, None]).clamp(min=NEAREST)
        there, away, _ = reprojected(surface[:, None], cameras, depth, targets)
        behind = ((away - there[:, 0]) / THICK).clamp(-1, 1)
        return torch.cat([behind, planes_of(targets, size)], dim=1)

    def relief(self, channels: Tensor) -> Tensor:
        """As `Relief` says."""
        return self.completed.relief(channels)


def lessons_of(rooms: Rooms, settings: Settings, folder: Path, progress: Any) -> Lessons:
    """Return the lessons of `depth-supervised`, for any view of the scene of each image."""
    lessons = depth_supervised.lessons_of(rooms, settings, folder, progress)
    return Lessons(lessons.rows, lessons.target, views_of_scenes(rooms), lessons.inside)


def views_of_scenes(rooms: Rooms) -> list[Tensor]:
    """Return for each row the rows that show its scene, itself among them."""
    order = torch.argsort(rooms.scene, stable=True)
    counts = torch.unique_consecutive(rooms.scene[order], return_counts=True)[1]
    views: list[Tensor] = [order] * len(rooms)
    for rows in torch.split(order, counts.tolist()):
        for row in rows.tolist():
            views[row] = rows
    return views


def lesson(run: Run, *, start: str | None = None) -> Lesson:
    """Return what a run learns: to complete what the first view of each scene shows.

    Args:
        start: weights of `depth-supervised`, whose network sees; those of the package by default.

    Raises SpecError where its size or width is another one, too.
    """
    own = None if start or run.earlier else bundled(FILES, depth_supervised.METHOD)
    begin = depth_supervised.beginning(run, start, own, lambda network: network.seen)
    return training.lesson(lessons_of, run, with_depth=True, prepare=begin)


BASELINE = Baseline(
    Method("depth-completed", Card, Completion),
    Settings,
    FILES,
    lesson,
    options=("start",),
    views=partial(views_of, depth_supervised.TOLD),
)
