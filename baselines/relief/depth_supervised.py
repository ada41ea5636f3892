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
from baselines.training.baseline import Baseline, Lesson, Run
from baselines.training.checkpoint import Method, load_weights
from baselines.training.rooms import Rooms
from scenegen.common.records import check

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


def started(network: Any, path: str | Path, settings: Settings) -> None:
    """Give a network the weights of a file. Raises SpecError where size or width are others."""
    known, card = load_weights(path, METHOD)
    sizes = [(s.size, s.width) for s in (card.settings, settings)]
    check(sizes[0] == sizes[1], "start", f"size and width {sizes[0]}", f"{sizes[1]}")
    network.load_state_dict(known.state_dict())


def lesson(run: Run, *, start: str | None = None) -> Lesson:
    """Return what a run learns. `start` is a file of weights to begin with, in place of random."""
    check(
        start is None or run.earlier is None, "start", start, "none when --resume continues a run"
    )

    def begin(network: Any) -> None:
        if start:
            started(network, start, run.settings)

    return training.lesson(lessons_of, run, with_depth=True, prepare=begin)


BASELINE = Baseline(
    METHOD,
    Settings,
    FILES,
    lesson,
    options=("start",),
    views=partial(views_of, TOLD),
)
