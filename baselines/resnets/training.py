"""Training on labelled questions: each iteration takes one step on one batch."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from baselines.resnets.answering import accuracy
from baselines.resnets.card import Answerer, Card, Settings
from baselines.training.checkpoint import WEIGHTS, save_weights
from baselines.training.data import TrainingFiles, only, requests
from baselines.training.fit import Loss, Progress, fit
from baselines.training.images import Draws, check_reducible, read_ahead
from baselines.training.machine import Machine, chosen_device
from baselines.training.questions import LABELED, check_labels, question_images, training_answers
from baselines.training.run_folder import alone_in, begun, earlier_state
from iqtt import QuestionsFile
from scenegen.common.random.seeding import Purpose, item_rng

VALIDATION = "iqtt-val.h5"


def train(
    kind: Answerer,
    data: TrainingFiles,
    run_folder: str | Path,
    settings: Settings = Settings(),  # noqa: B008 (it is frozen)
    machine: Machine | None = None,
    *,
    labels: int | None = None,
    resume: bool = False,
    progress: Progress = lambda done, total, numbers: None,
) -> Path:
    """Train on the labelled questions of a file, as `baselines.training` says.

    Args:
        labels: how many of the labelled questions to use, the first ones; None for all.
        progress: called once more at the end, with the accuracy on iqtt-val.h5 if it lies beside
            `data`.
    """
    folder, method, machine = Path(run_folder), kind.method, machine or Machine()
    device = chosen_device(machine.device)
    with alone_in(folder):
        earlier = earlier_state(folder, method, resume)
        if earlier is not None:
            settings, labels = earlier.card.settings, earlier.card.labels
        questions = only(data.questions(LABELED), method.name)
        labels = len(questions) if labels is None else labels
        check_labels(questions, labels, 1)
        check_reducible(questions.path, questions.height, questions.width, settings.size)
        told = requests([questions])
        card = Card(method.name, settings, labels=labels, answers=questions.answers, **told)
        state = begun(method, card, earlier, data.where, device)
        right = training_answers(questions, labels)
        first = state.card.iteration
        batches = read_ahead(_batches(questions, right, settings, first), device)

        def losses(_number: int) -> Iterator[Loss]:
            batch = next(batches)
            loss = kind.loss(state.network(batch.images), batch.right)
            yield Loss(loss, {"loss": loss})

        fit(folder, method, state, losses, _rate, machine, progress=progress)
        beside = questions.path.with_name(VALIDATION)
        share = accuracy(state.network, beside, settings.size, card.answers)
        if share is not None:
            last = state.card.iteration
            progress(last, last, {f"accuracy on {VALIDATION}": share})
        state.card = replace(state.card, validation=share)
        save_weights(folder / WEIGHTS, method, state.network, state.card)
    return folder / WEIGHTS


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
