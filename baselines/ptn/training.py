"""What networks learn: the projection loss, and what batches are drawn from.

The loss is the projection loss of Yan et al. (NeurIPS 2016): the mean squared difference of the
volume's silhouettes from the true ones, over the views of each image. There is no loss on volumes.
"""

import itertools
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import torch
from torch import Tensor

from baselines.ptn import projection
from baselines.ptn.matching import features, fitted_head
from baselines.ptn.network import METHOD, Card, Ptn, Settings
from baselines.ptn.projection import Batch
from baselines.ptn.questions import BOX, TrainingShapes
from baselines.ptn.rooms import TrainingRooms, room_box
from baselines.ptn.submission import AT_ONCE, answers_of, views_of
from baselines.training.baseline import Baseline, Lesson, Run
from baselines.training.checkpoint import State, load_weights
from baselines.training.data import only
from baselines.training.fit import Loss
from baselines.training.images import check_reducible
from baselines.training.questions import (
    LABELED,
    UNLABELED,
    check_labels,
    each_question,
    training_answers,
)
from iqtt import QuestionsFile
from scenegen.common.random.seeding import Purpose, item_rng
from scenegen.common.records import check


def lesson(run: Run, *, labels: int = 0, networks: str | None = None) -> Lesson:
    """Return what a run learns from a file of rooms of several views, or of questions.

    Args:
        labels: how many answers to learn from, the first ones; they weigh what tells answers apart
            (`matching.FEATURES`) and do not change the networks.
        networks: weights of another run, whose networks are taken as they are: only `labels` are
            learnt from then.
    """
    model = None
    if run.earlier is not None:
        card = run.earlier
    elif networks is not None:
        alone = replace(run.settings, seed=0) == Settings()
        check(alone, "networks", networks, "no other settings: they have their own")
        model, card = load_weights(networks, METHOD)
        card = replace(card, labels=labels, head=())
    else:
        card = Card(run.method, run.settings, labels=labels)
    source: TrainingShapes | TrainingRooms
    if run.data.hold_questions:
        unlabelled = only(run.data.questions(UNLABELED), run.method)
        source, task, box = TrainingShapes(unlabelled, card.settings), "questions", BOX
    else:
        check(card.labels == 0, "labels", card.labels, "0 for rooms, which ask no questions")
        rooms = only(run.data.rooms(), run.method)
        source, task, box = TrainingRooms(rooms, card.settings), "rooms", room_box(rooms.spec)
    trained = run.earlier is not None or model is not None
    check(not trained or card.task == task, "data", task, f"{card.task}, as the run began with")
    labelled = None
    if card.labels:  # looked at before hours of training
        labelled = only(run.data.questions(LABELED), run.method)
        check_labels(labelled, card.labels)
        check_reducible(run.data.where, labelled.height, labelled.width, card.settings.size)
    if model is None:
        told = {"data": source.data, "fingerprint": source.fingerprint}
        card = replace(card, task=task, low=box[0], high=box[1], **told)
    batches = partial(_batches, source, card.settings.seed)
    return Lesson(card, batches, _loss, network=model, finish=partial(_with_head, labelled))


def _loss(state: State[Card, Ptn], batch: Batch, _number: int) -> Loss:
    loss = projection_loss(state.network, batch)
    return Loss(loss, {"loss": loss})


def _batches(source: TrainingShapes | TrainingRooms, seed: int, first: int) -> Iterator[Batch]:
    """Yield the batches of iteration `first` and of those after it, without end."""
    for number in itertools.count(first):
        yield source.batch(item_rng(seed, number, Purpose.TRAINING))


def _with_head(labelled: QuestionsFile | None, model: Ptn, card: Card) -> Card:
    """Return the card with the weights of features of answers, by what the first answers tell."""
    if labelled is None:
        return card
    model.cpu().eval()
    values = each_question(
        labelled, model.settings.size, lambda images: features(model, images), AT_ONCE, card.labels
    )
    return replace(card, head=fitted_head(values, training_answers(labelled, card.labels)))


def projection_loss(model: Ptn, batch: Batch) -> Tensor:
    """Return the mean squared difference of silhouettes over a batch's rays, ()."""
    volume = model(batch.image, batch.camera)
    rays = batch.origin, batch.direction
    shown = projection.silhouettes(volume, model.box, *rays, model.settings.samples)
    return torch.mean((shown - batch.silhouette) ** 2)


BASELINE = Baseline(
    METHOD,
    Settings,
    Path(__file__).with_name("files"),
    lesson,
    options=("labels", "networks"),
    answers=answers_of,
    views=views_of,
)
