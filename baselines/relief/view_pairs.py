"""`view-pairs`: relief by matching views of a scene, then a network that gives it from one image.

Training data are rooms of several views, neighbours at most 20 degrees apart, such as `scenegen
render --views 0,10,20,30,40,50,60,70,80 --image-dtype float16`. Images and cameras are read, and no
depth, normals, ids or lights.
"""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from baselines.pix2shape.matching import matched_rows, relief_of_rows
from baselines.relief import training
from baselines.relief.network import Card, Settings, relief_network
from baselines.relief.training import FILES, Lessons, views_of
from baselines.training.baseline import Baseline
from baselines.training.checkpoint import Method
from baselines.training.rooms import Rooms


def lessons_of(
    rooms: Rooms, _settings: Settings, folder: Path, progress: Callable[[int, int], Any]
) -> Lessons:
    """Return the relief that matching finds, of the rows that have a partner."""
    relief = relief_of_rows(rooms, folder, progress)

    def target(rows: Tensor) -> tuple[Tensor, Tensor]:
        goal = relief[rows].float()
        return goal, torch.ones_like(goal)

    return Lessons(matched_rows(rooms), target)


BASELINE = Baseline(
    Method("view-pairs", Card, relief_network),
    Settings,
    FILES,
    partial(training.lesson, lessons_of),
    views=partial(views_of, ""),
)
