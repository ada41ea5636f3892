"""`train`: relief by matching views of a scene, then a network that gives it from one image."""

from pathlib import Path

import torch
from torch import Tensor

from baselines import checkpoints
from baselines.depth_supervised.card import Card
from baselines.depth_supervised.network import ReliefSpec
from baselines.depth_supervised.training import Progress, Target, begun, fit
from baselines.pix2shape.matching.labels import labels, matched_rows

METHOD = "view-pairs"


@checkpoints.one_at_a_time
def train(
    data: str | Path,
    run_folder: str | Path,
    *,
    seed: int = 0,
    resume: bool = False,
    progress: Progress = lambda done, total, losses: None,
    iterations: int = 1200,
    batch: int = 16,
    learning_rate: float = 0.003,
    size: int = 64,
    width: float = 1.0,
) -> Path:
    """Train a network on images of rooms and their cameras alone; return the path of the weights.

    Args:
        data: rooms of several views, neighbours at most 20 degrees apart, such as `scenegen render
            --views 0,10,20,30,40,50,60,70,80 --image-dtype float16`. Images and cameras are read,
            and no depth, normals, ids or lights.
        run_folder: gets labels, checkpoint and weights.
        progress: called with the share of images that were matched, too, before the iterations.

    The other arguments and errors are those of `baselines.depth_supervised.training.train`; the
    network is "unet".
    """
    spec = ReliefSpec("unet", size, width)
    card = Card(METHOD, spec, seed, iterations, batch, learning_rate)
    state, rooms = begun(data, run_folder, card, resume)
    at, last = state.card.iteration, state.card.iterations

    def matching(done: int, total: int) -> None:
        progress(at, last, {"share of images matched": done / total})

    relief = labels(rooms, run_folder, matching)

    def target(rows: Tensor) -> Target:
        found = relief[rows].float()
        return Target(found, torch.ones_like(found))

    return fit(state, rooms, run_folder, target, progress, allowed=matched_rows(rooms))
