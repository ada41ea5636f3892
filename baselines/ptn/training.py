"""`train`: the projection loss, its iterations, and a run's folder with checkpoint and weights.

The loss is the projection loss of Yan et al. (NeurIPS 2016): the mean squared difference of the
volume's silhouettes from the true ones, over the views of each image. There is no loss on volumes.
"""

import time
from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import fields, replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import torch
from torch import Tensor

from baselines import checkpoints
from baselines.pix2shape.data.rooms import check_reducible, is_question_file
from baselines.ptn import projection
from baselines.ptn.batches import Batch
from baselines.ptn.card import RECIPE, Card, State
from baselines.ptn.matching import fitted_head
from baselines.ptn.network import Ptn, PtnConfig
from baselines.ptn.questions import BOX, TrainingShapes, check_questions
from baselines.ptn.rooms import TrainingRooms, room_box
from baselines.ptn.submission import feature_batches
from iqtt.files.reader import QuestionsFile, open_questions
from scenegen.common.errors import SceneGenError, SpecError
from scenegen.common.random.seeding import Purpose, item_rng
from scenegen.common.records import check

EVERY = 200  # iterations between checkpoints
SETTINGS = {field.name for field in fields(PtnConfig)} - {"task", "low", "high", "seed"}
Progress = Callable[[int, int, Mapping[str, float]], Any]  # iterations done, in all, losses


class Source(Protocol):
    """Where batches come from."""

    fingerprint: str
    data: str

    def batch(self, rng: np.random.Generator) -> Batch:
        """Draw a batch."""

    def close(self) -> None:
        """Close the file."""


@checkpoints.one_at_a_time
def train(
    data: str | Path,
    run_folder: str | Path,
    *,
    labels: int = 0,
    seed: int = 0,
    iterations: int | None = None,
    silhouettes: str | None = None,
    width: int | None = None,
    size: int | None = None,
    batch: int | None = None,
    views: int | None = None,
    rays: int | None = None,
    samples: int | None = None,
    learning_rate: float | None = None,
    weight_decay: float | None = None,
    networks: str | Path | None = None,
    resume: bool = False,
    progress: Progress = lambda done, total, losses: None,
) -> Path:
    """Train on a file of rooms or of questions; return the path of the weights.

    Args:
        data: rooms of several views, or a training file such as iqtt-train.h5.
        run_folder: gets checkpoint and weights.
        labels: how many answers to learn from, the first ones; they weigh what tells answers apart
            (`matching.FEATURES`) and do not change the networks.
        iterations, ..., weight_decay: fields of `PtnConfig`; None for their defaults.
        networks: weights of another run, whose networks are taken as they are: only `labels` are
            learnt from then.
        resume: go on from the folder's checkpoint, with the run's own settings and labels.
        progress: called after each iteration.

    The same arguments give the same weights on one machine, however often a run is resumed.

    Raises SpecError where settings and data do not fit; FileExistsError where a new run finds a
    checkpoint; SceneGenError where the loss is not finite; FileFormatError; OSError.
    """
    given = {name: value for name, value in locals().items() if name in SETTINGS}
    settings = {name: value for name, value in given.items() if value is not None}
    folder = Path(run_folder)
    if resume:
        state = checkpoints.load_checkpoint(folder, RECIPE)
    else:
        checkpoints.check_new(folder)
        if networks is not None:
            state = checkpoints.load_weights(networks, RECIPE)
            check(not settings, "networks", networks, "no other settings: they have their own")
            _check_task(data, state.card.config)
            state.card = replace(state.card, labels=labels, head=())
        else:
            config = _config(data, settings | {"seed": seed})
            state = checkpoints.new_state(RECIPE, Card(config, labels=labels))
    labels = state.card.labels
    found = labelled(data, state.card.config, labels)  # before hours of training
    if networks is None or resume:
        _iterate(data, folder, state, progress)
    if found is not None:
        with found:
            right = torch.from_numpy(found.read("answers", slice(0, labels)).astype(np.int64))
            told = torch.cat(list(feature_batches(state.network.eval(), found, labels)))
        state.card = replace(state.card, head=fitted_head(told, right))
    checkpoints.save_weights(folder / checkpoints.WEIGHTS, state)
    return folder / checkpoints.WEIGHTS


def _iterate(data: str | Path, folder: Path, state: State, progress: Progress) -> None:
    """Take the iterations that are left, with a checkpoint every now and then."""
    card, config, optimiser = state.card, state.card.config, state.optimiser
    with closing(_source(data, config)) as source:
        if card.iteration:
            checkpoints.check_data(data, source.fingerprint, card.fingerprint)
        card = replace(card, fingerprint=source.fingerprint, data=source.data)
        began, last = time.monotonic() - card.seconds, config.iterations
        for iteration in range(card.iteration, last):
            batch = source.batch(item_rng(config.seed, iteration, Purpose.TRAINING))
            for group in optimiser.param_groups:
                group["lr"] = config.learning_rate * min(1.0, 2 * (1 - iteration / last))
            loss = projection_loss(state.network, batch)
            if not torch.isfinite(loss):
                hint = "begin again with a smaller learning rate"
                raise SceneGenError(
                    f"iteration {iteration}", "a loss that is not finite", hint=hint
                )
            optimiser.zero_grad()
            loss.backward()  # type: ignore[no-untyped-call]
            optimiser.step()
            done = iteration + 1
            if done % EVERY == 0 or done == last:
                seconds = round(time.monotonic() - began, 1)
                state.card = replace(card, iteration=done, seconds=seconds)
                checkpoints.save_checkpoint(folder, state)
                checkpoints.save_weights(folder / checkpoints.WEIGHTS, state)
            progress(done, last, {"loss": float(loss.detach())})


def labelled(data: str | Path, config: PtnConfig, labels: int) -> QuestionsFile | None:
    """Open the labelled questions of a training file; None where none are asked for.

    Raises SpecError where there are fewer, or none at all, as in rooms.
    """
    if labels == 0:
        return None
    check(config.task == "questions", "labels", labels, "0 for rooms, which ask no questions")
    questions = open_questions(data, "labeled")
    count = len(questions) if questions.has_answers else 0
    try:
        check(0 <= labels <= count, "labels", labels, f"0 to {count}, as many answers are told")
        check_reducible(data, questions.height, questions.width, config.size)
    except BaseException:
        questions.close()
        raise
    return questions


def projection_loss(model: Ptn, batch: Batch) -> Tensor:
    """Return the mean squared difference of silhouettes over a batch's rays, ()."""
    volume = model(batch.image, batch.camera)
    rays = batch.origin, batch.direction
    shown = projection.silhouettes(volume, model.box, *rays, model.config.samples)
    return torch.mean((shown - batch.silhouette) ** 2)


def _config(data: str | Path, settings: dict[str, Any]) -> PtnConfig:
    """Return the configuration that suits a file."""
    if is_question_file(data):
        check_questions(data)
        return PtnConfig("questions", *BOX, **settings)
    return PtnConfig("rooms", *room_box(data), **settings)


def _source(data: str | Path, config: PtnConfig) -> Source:
    _check_task(data, config)
    return (TrainingShapes if config.task == "questions" else TrainingRooms)(data, config)


def _check_task(data: str | Path, config: PtnConfig) -> None:
    if is_question_file(data) != (config.task == "questions"):
        raise SpecError(data, "a file of the other task", f"{config.task}, as the run was trained")
