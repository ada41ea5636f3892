"""`depth-supervised`: a relief network that learns from true depth and object ids."""

from collections.abc import Callable
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


def beginning(
    run: Run,
    start: str | None,
    default: Path | None = None,
    part: Callable[[Any], Any] = lambda network: network,
) -> Callable[[Any], None]:
    """Return what gives a new run's network, or a part of it, the weights of a file.

    Args:
        start: the file; None for `default`, and without one weights stay random.

    Raises SpecError where a run goes on, and later where size or width are others.
    """
    new = run.earlier is None
    check(start is None or new, "start", start, "none, because --resume continues a run")

    def begin(network: Any) -> None:
        if path := start or default:
            known, card = load_weights(path, METHOD)
            sizes = [(s.size, s.width) for s in (card.settings, run.settings)]
            check(sizes[0] == sizes[1], "start", f"size and width {sizes[0]}", f"{sizes[1]}")
            part(network).load_state_dict(known.state_dict())

    return begin


def lesson(run: Run, *, start: str | None = None) -> Lesson:
    """Return what a run learns; `start` is a file of initial weights, None for random ones."""
    return training.lesson(lessons_of, run, with_depth=True, prepare=beginning(run, start))


BASELINE = Baseline(
    METHOD,
    Settings,
    FILES,
    lesson,
    options=("start",),
    views=partial(views_of, TOLD),
)
