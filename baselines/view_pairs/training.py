"""`train`: relief by matching views of a scene, then a network that gives it from one image."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from baselines.depth_supervised.network import ReliefSpec
from baselines.depth_supervised.rooms import read_rooms
from baselines.depth_supervised.storage import Card
from baselines.depth_supervised.training import Target, begun, fit, suited
from baselines.view_pairs.labels import labels

METHOD = "view-pairs"
Progress = Callable[[int, int, Mapping[str, float]], Any]  # iterations done, in all, losses


def train(
    data: str | Path,
    run_folder: str | Path,
    *,
    seed: int = 0,
    resume: bool = False,
    progress: Progress = lambda done, total, losses: None,
    labelling: Callable[[int, int], Any] = lambda done, total: None,
    network: ReliefSpec | None = None,
    **settings: Any,
) -> Path:
    """Train a network on images of rooms and their cameras alone; return the path of the weights.

    Args:
        data: rooms of several views, neighbours at most 20 degrees apart, such as `scenegen render
            --views 0,10,20,30,40,50,60,70,80 --image-dtype float16`. Images and cameras are read,
            and no depth, normals, ids or lights.
        run_folder: gets labels, checkpoint and weights.
        labelling: called with the images that were matched, and how many there are.

    The other arguments and errors are those of `baselines.depth_supervised.training.train`.
    """
    state = begun(run_folder, Card(METHOD, network or ReliefSpec(), seed, **settings), resume)
    rooms = read_rooms(data, state.card.network.size)
    state = suited(state, rooms, data)
    relief, matched = labels(rooms, run_folder, labelling)

    def target(rows: Tensor) -> Target:
        found = relief[rows].float()
        return Target(found, torch.ones_like(found))

    return fit(state, rooms, run_folder, target, progress, allowed=matched)
