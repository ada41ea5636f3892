"""`train`: the projection loss, and what batches are drawn from.

The loss is the projection loss of Yan et al. (NeurIPS 2016): the mean squared difference of the
volume's silhouettes from the true ones, over the views of each image. There is no loss on volumes.
"""

import itertools
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import torch
from torch import Tensor

from baselines.ptn import projection
from baselines.ptn.matching import features, fitted_head
from baselines.ptn.network import METHOD, Card, Ptn, Settings
from baselines.ptn.projection import Batch
from baselines.ptn.questions import BOX, TrainingShapes
from baselines.ptn.rooms import TrainingRooms, room_box
from baselines.ptn.submission import AT_ONCE
from baselines.training.checkpoint import WEIGHTS, load_weights, save_weights
from baselines.training.data import TrainingFiles, only
from baselines.training.fit import Loss, Progress, falling_late, fit
from baselines.training.images import check_reducible, read_ahead
from baselines.training.machine import Machine, chosen_device
from baselines.training.questions import (
    LABELED,
    UNLABELED,
    check_labels,
    each_question,
    training_answers,
)
from baselines.training.run_folder import alone_in, begun, earlier_state
from iqtt import QuestionsFile
from scenegen.common.random.seeding import Purpose, item_rng
from scenegen.common.records import check


def train(
    data: TrainingFiles,
    run_folder: str | Path,
    settings: Settings = Settings(),  # noqa: B008 (it is frozen)
    machine: Machine | None = None,
    *,
    labels: int = 0,
    networks: str | None = None,
    resume: bool = False,
    progress: Progress = lambda done, total, losses: None,
) -> Path:
    """Train on a file of rooms of several views or of questions, as `baselines.training` says.

    Args:
        labels: how many answers to learn from, the first ones; they weigh what tells answers apart
            (`matching.FEATURES`) and do not change the networks.
        networks: weights of another run, whose networks are taken as they are: only `labels` are
            learnt from then.
    """
    folder, machine = Path(run_folder), machine or Machine()
    device = chosen_device(machine.device)
    with alone_in(folder):
        earlier = earlier_state(folder, METHOD, resume)
        model = None
        if earlier is not None:
            card = earlier.card
        elif networks is not None:
            alone = replace(settings, seed=0) == Settings()
            check(alone, "networks", networks, "no other settings: they have their own")
            model, card = load_weights(networks, METHOD)
            card = replace(card, labels=labels, head=())
        else:
            card = Card("ptn", settings, labels=labels)
        source: TrainingShapes | TrainingRooms
        if data.hold_questions:
            unlabelled = only(data.questions(UNLABELED), "ptn")
            source, task, box = TrainingShapes(unlabelled, card.settings), "questions", BOX
        else:
            check(card.labels == 0, "labels", card.labels, "0 for rooms, which ask no questions")
            rooms = only(data.rooms(), "ptn")
            source, task, box = TrainingRooms(rooms, card.settings), "rooms", room_box(rooms.spec)
        trained = earlier is not None or model is not None
        check(not trained or card.task == task, "data", task, f"{card.task}, as the run began with")
        labelled = None
        if card.labels:  # looked at before hours of training
            labelled = only(data.questions(LABELED), "ptn")
            check_labels(labelled, card.labels)
            check_reducible(data.where, labelled.height, labelled.width, card.settings.size)
        if model is None:
            card = replace(card, task=task, low=box[0], high=box[1])
            card = replace(card, data=source.data, fingerprint=source.fingerprint)
            state = begun(METHOD, card, earlier, data.where, device)
            first = state.card.iteration
            batches = read_ahead(_batches(source, card.settings.seed, first), device)

            def losses(_number: int) -> Iterator[Loss]:
                loss = projection_loss(state.network, next(batches))
                yield Loss(loss, {"loss": loss})

            fit(folder, METHOD, state, losses, falling_late, machine, progress=progress)
            model, card = state.network.cpu(), state.card
        if labelled is not None:
            card = replace(card, head=_head(model.eval(), labelled, card.labels))
        save_weights(folder / WEIGHTS, METHOD, model, card)
    return folder / WEIGHTS


def _batches(source: TrainingShapes | TrainingRooms, seed: int, first: int) -> Iterator[Batch]:
    """Yield the batches of iteration `first` and of those after it, without end."""
    for number in itertools.count(first):
        yield source.batch(item_rng(seed, number, Purpose.TRAINING))


def _head(model: Ptn, labelled: QuestionsFile, labels: int) -> tuple[float, ...]:
    """Return how features of answers are weighted, by what the first answers tell."""
    values = each_question(
        labelled, model.settings.size, lambda images: features(model, images), AT_ONCE, labels
    )
    return fitted_head(values, training_answers(labelled, labels))


def projection_loss(model: Ptn, batch: Batch) -> Tensor:
    """Return the mean squared difference of silhouettes over a batch's rays, ()."""
    volume = model(batch.image, batch.camera)
    rays = batch.origin, batch.direction
    shown = projection.silhouettes(volume, model.box, *rays, model.settings.samples)
    return torch.mean((shown - batch.silhouette) ** 2)
