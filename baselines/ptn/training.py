"""`train`: the projection loss, its iterations, and a run's folder with checkpoint and weights.

The loss is that of Yan et al. (equation 4): the mean squared difference of the volume's silhouettes
from the true ones, over the views of each image. There is no loss on volumes.
"""

import errno
import time
from collections.abc import Callable
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import torch
from torch import Tensor

from baselines.pix2shape.data.rooms import is_question_file
from baselines.ptn.batches import Batch
from baselines.ptn.network import Ptn, PtnConfig
from baselines.ptn.projection import silhouettes
from baselines.ptn.questions import TrainingShapes, question_box
from baselines.ptn.rooms import TrainingRooms, room_box
from baselines.ptn.storage import (
    CHECKPOINT,
    WEIGHTS,
    Card,
    load_checkpoint,
    new_model,
    save_checkpoint,
    save_weights,
)
from scenegen.common.errors import SpecError
from scenegen.common.seeding import Purpose, item_rng

Progress = Callable[[int, int, float], Any]  # iterations done, iterations in all, loss


class Source(Protocol):
    """Where batches come from."""

    fingerprint: str
    data: str

    def batch(self, rng: np.random.Generator) -> Batch:
        """Draw a batch."""

    def close(self) -> None:
        """Close the file."""


class TrainingError(SpecError):
    """A loss that is not finite."""


def train(
    data: str | Path,
    run_folder: str | Path,
    *,
    seed: int = 0,
    resume: bool = False,
    every: int = 200,
    progress: Progress = lambda done, total, loss: None,
    **settings: Any,
) -> Path:
    """Train on a file of rooms or of questions; return the path of the weights.

    Args:
        data: rooms of several views, or a training file such as iqtt-train.h5.
        run_folder: gets checkpoint and weights.
        resume: go on from the folder's checkpoint, with its settings and seed.
        every: iterations between checkpoints.
        settings: fields of `PtnConfig` in place of the defaults.

    The same arguments give the same weights on one machine, however often a run is resumed.

    Raises SpecError where settings and data do not fit; FileExistsError where a new run finds a
    checkpoint; TrainingError; FileFormatError; OSError.
    """
    folder = Path(run_folder)
    if resume:
        if settings or seed:
            raise SpecError("resume", "other settings", "none, as the run has its own")
        model, optimiser, card = load_checkpoint(folder)
    else:
        if (folder / CHECKPOINT).exists():
            what = "holds a checkpoint; say --resume, or name another folder"
            raise FileExistsError(errno.EEXIST, what, str(folder))
        card = Card(_config(data, settings | {"seed": seed}))
        model, optimiser = new_model(card.config)
    with closing(_source(data, card.config)) as source:
        if resume and source.fingerprint != card.fingerprint:
            expected = f"{card.fingerprint[:12]}, on which the run was trained"
            raise SpecError(data, f"fingerprint {source.fingerprint[:12]}", expected)
        card = replace(card, fingerprint=source.fingerprint, data=source.data)
        folder.mkdir(parents=True, exist_ok=True)
        started, before = time.monotonic(), card.seconds
        last = card.config.iterations
        for iteration in range(card.iteration, last):
            batch = source.batch(item_rng(card.config.seed, iteration, Purpose.TRAINING))
            for group in optimiser.param_groups:
                group["lr"] = card.config.learning_rate * min(1.0, 2 * (1 - iteration / last))
            loss = projection_loss(model, batch)
            if not torch.isfinite(loss):
                hint = "begin again with a smaller learning rate"
                raise TrainingError(f"iteration {iteration}", "a loss that is not finite", hint=hint)
            optimiser.zero_grad()
            loss.backward()  # type: ignore[no-untyped-call]
            optimiser.step()
            done = iteration + 1
            if done % every == 0 or done == last:
                seconds = round(before + time.monotonic() - started, 1)
                card = replace(card, iteration=done, seconds=seconds)
                save_checkpoint(folder, model, optimiser, card)
                save_weights(folder / WEIGHTS, model, card)
            progress(done, last, float(loss.detach()))
    return folder / WEIGHTS


def projection_loss(model: Ptn, batch: Batch) -> Tensor:
    """Return the mean squared difference of silhouettes over a batch's rays, ()."""
    volume = model(batch.image, batch.camera)
    rays = batch.origin, batch.direction
    shown = silhouettes(volume, model.box, *rays, model.config.samples)
    return torch.mean((shown - batch.silhouette) ** 2)


def _config(data: str | Path, settings: dict[str, Any]) -> PtnConfig:
    """Return the configuration that suits a file."""
    if is_question_file(data):
        return PtnConfig(task="questions", **question_box(data), **settings)
    return PtnConfig(task="rooms", **room_box(data), **settings)


def _source(data: str | Path, config: PtnConfig) -> Source:
    if is_question_file(data) != (config.task == "questions"):
        raise SpecError(data, "a file of the other task", f"{config.task}, as the run was trained")
    return (TrainingShapes if config.task == "questions" else TrainingRooms)(data, config)
