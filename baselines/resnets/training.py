"""ResNets that answer questions: settings, card, training on labelled questions, and answers."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import ClassVar

import numpy as np
import torch
from torch import Tensor, nn

from baselines.resnets.architecture import DEPTHS
from baselines.training import checkpoint
from baselines.training.baseline import Answers, Baseline, Lesson, Run
from baselines.training.checkpoint import Method, Ranges, State, check_numbers
from baselines.training.data import only, requests
from baselines.training.fit import Loss
from baselines.training.images import Draws, check_reducible
from baselines.training.machine import chosen_device
from baselines.training.questions import (
    LABELED,
    check_labels,
    each_question,
    question_images,
    training_answers,
)
from iqtt import QuestionsFile, open_questions
from scenegen.common.errors import SpecError
from scenegen.common.random.seeding import Purpose, item_rng
from scenegen.common.records import LARGEST, check

VALIDATION = "iqtt-val.h5"
AnswerLoss = Callable[[Tensor, Tensor], Tensor]
BATCH = 32  # questions at a time


@dataclass(frozen=True)
class Settings(checkpoint.Settings):
    """Settings of networks and training; `size` is 128 in the paper's released files.

    Attributes:
        depth: 18 or 50 layers of the ResNet; 50 in the paper.
        width: channels of its first stage; 64 in the paper.
        learning_rate: of the first step; it falls linearly to 0.
    """

    RANGES: ClassVar[Ranges] = {"width": (4, 256), "size": (16, 1024), "batch": (1, 4096)}
    depth: int = 18
    width: int = 16
    iterations: int = 400

    def __post_init__(self) -> None:
        check(self.depth in DEPTHS, "depth", self.depth, " or ".join(map(str, DEPTHS)))
        super().__post_init__()


@dataclass(frozen=True)
class Card(checkpoint.Card):
    """The card of a ResNet.

    Attributes:
        answers: number of answers of each question.
        validation: accuracy on iqtt-val.h5 beside the training file; None where there is none.
    """

    settings: Settings
    answers: int = 3
    validation: float | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        check_numbers(self, {"answers": (2, 16), "labels": (1, LARGEST)})


def resnet_baseline(
    method: Method[Card, nn.Module], loss: AnswerLoss, *, any_number: bool
) -> Baseline:
    """Return a baseline that answers questions with a ResNet.

    Args:
        method: its network takes images of questions, (Q, 1 + K, 3, S, S), the reference first, and
            gives the scores of the K answers, (Q, K), the highest of which is its answer.
        loss: of scores, (Q, K), and right answers, (Q,).
        any_number: as `answers_of`.
    """
    return Baseline(
        method,
        Settings,
        Path(__file__).with_name("files"),
        partial(lesson, loss),
        options=("labels",),
        answers=partial(answers_of, any_number),
    )


def lesson(loss: AnswerLoss, run: Run, *, labels: int | None = None) -> Lesson:
    """Return what a run learns: the labelled questions of a file.

    At the end progress is called once more, with the accuracy on iqtt-val.h5 if it lies beside the
    file.

    Args:
        labels: how many of the labelled questions to use, the first ones; None for all.
    """
    settings = run.settings
    questions = only(run.data.questions(LABELED), run.method)
    if run.earlier is not None:
        labels = run.earlier.labels
    labels = len(questions) if labels is None else labels
    check_labels(questions, labels, 1)
    check_reducible(questions.path, questions.height, questions.width, settings.size)
    told = requests([questions])
    right = training_answers(questions, labels)

    def loss_of(state: State[Card, nn.Module], batch: Batch, _number: int) -> Loss:
        value = loss(state.network(batch.images), batch.right)
        return Loss(value, {"loss": value})

    def validated(network: nn.Module, card: Card) -> Card:
        beside = questions.path.with_name(VALIDATION)
        share = accuracy(network, beside, settings.size, card.answers)
        if share is not None:
            run.progress(card.iteration, card.iteration, {f"accuracy on {VALIDATION}": share})
        return replace(card, validation=share)

    return Lesson(
        Card(run.method, settings, labels=labels, answers=questions.answers, **told),
        partial(_batches, questions, right, settings),
        loss_of,
        _rate,
        finish=validated,
    )


@dataclass(frozen=True, eq=False)
class Batch:
    """Images of questions, (Q, 1 + K, 3, S, S), the reference first, and right answers, (Q,)."""

    images: Tensor
    right: Tensor


def _batches(
    questions: QuestionsFile, right: Tensor, settings: Settings, first: int
) -> Iterator[Batch]:
    """Yield the batches of iteration `first` and of those after it, without end."""
    draws = Draws(len(right), settings.batch, settings.seed, first)
    for number, rows in enumerate(draws, first):
        shown = np.stack([question_images(questions, row, settings.size) for row in rows])
        yield Batch(*permuted(torch.from_numpy(shown), right[rows], settings.seed, number))


def _rate(settings: Settings, iteration: int) -> float:
    return settings.learning_rate * (1 - iteration / settings.iterations)


def permuted(images: Tensor, right: Tensor, seed: int, iteration: int) -> tuple[Tensor, Tensor]:
    """Return the questions of a batch with their answers in a random order, each in its own.

    So 200 labels say as much about each place of an answer as about the others. Images are
    (Q, 1 + K, 3, S, S), the reference first; right answers (Q,).
    """
    count = images.shape[1] - 1
    draws = item_rng(seed, iteration, Purpose.TRAINING)
    order = torch.from_numpy(draws.permuted(np.tile(np.arange(count), (len(images), 1)), axis=1))
    rows = torch.arange(len(images))[:, None]
    mixed = torch.cat([images[:, :1], images[rows, 1 + order]], dim=1)
    return mixed, (order == right[:, None]).int().argmax(dim=1)


def answers_of(
    any_number: bool, network: nn.Module, card: Card, questions: QuestionsFile
) -> Answers:
    """Return how a network answers questions.

    Args:
        any_number: whether it answers questions of another number of answers than it was trained
            on.

    Raises SpecError where it does not.
    """
    count = questions.answers
    if count != card.answers and not any_number:
        raise SpecError(
            questions.path,
            f"questions with {count} options",
            f"{card.answers}, as those that {card.method} was trained on",
            f"its last layer has one output per option; train it on questions with {count}",
        )
    device = chosen_device("auto")
    network.to(device)
    run = f"{card.labels} labels, seed {card.settings.seed}"
    return Answers(lambda images: scores(network, images.to(device)), BATCH, run=run)


def scores(network: nn.Module, images: Tensor) -> Tensor:
    """Return the score of each answer, (Q, K), of images on the network's device."""
    answered: Tensor = network.eval()(images)
    return answered


def accuracy(network: nn.Module, path: Path, size: int, answers: int) -> float | None:
    """Return the share of a file's questions that are answered right.

    None where there is no such file, or it has no questions of so many answers, or tells none.
    """
    if not path.is_file():
        return None
    device = next(network.parameters()).device
    with open_questions(path) as questions:
        if not len(questions) or not questions.has_answers or questions.answers != answers:
            return None
        values = each_question(
            questions, size, lambda images: scores(network, images.to(device)), BATCH
        )
        chosen = values.argmax(dim=1).numpy()
        return float((chosen == questions.read("answers", slice(None))).mean())
