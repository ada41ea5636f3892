"""Training on labelled questions: each iteration takes one step on one batch."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from baselines.resnets.answering import accuracy
from baselines.resnets.card import Answerer, Card, Settings
from baselines.training.checkpoint import WEIGHTS, save_weights
from baselines.training.fit import Loss, Progress, fit
from baselines.training.images import Draws, check_reducible
from baselines.training.launch import chosen_device
from baselines.training.questions import (
    LABELED,
    check_labels,
    open_training,
    question_images,
    training_answers,
)
from baselines.training.run_folder import alone_in, begun, earlier_state
from scenegen.common.random.seeding import Purpose, item_rng

VALIDATION = "iqtt-val.h5"
EVERY = 100  # iterations between checkpoints


def train(
    kind: Answerer,
    data: str | Path,
    run_folder: str | Path,
    settings: Settings = Settings(),  # noqa: B008 (it is frozen)
    *,
    labels: int | None = None,
    device: str = "auto",
    resume: bool = False,
    progress: Progress = lambda done, total, numbers: None,
) -> Path:
    """Train on the labelled questions of a file, as `baselines.training` says.

    Args:
        labels: how many of the labelled questions to use, the first ones; None for all.
        device: "auto", "cpu" or "cuda".
        progress: called once more at the end, with the accuracy on iqtt-val.h5 if it lies beside
            `data`.
    """
    folder, method = Path(run_folder), kind.method
    with alone_in(folder), open_training(data, LABELED) as questions:
        earlier = earlier_state(folder, method, resume)
        if earlier is not None:
            settings, labels = earlier.card.settings, earlier.card.labels
        labels = len(questions) if labels is None else labels
        check_labels(questions, labels, 1)
        check_reducible(data, questions.height, questions.width, settings.size)
        card = Card(
            method.name,
            settings,
            labels=labels,
            fingerprint=str(questions.fingerprint or ""),
            answers=questions.answers,
        )
        state = begun(method, card, earlier, data)
        state.to(chosen_device(device))
        draws = iter(Draws(labels, settings.batch, settings.seed, state.card.iteration))
        right = training_answers(questions, labels)
        where = next(state.network.parameters()).device

        def losses(number: int) -> Iterator[Loss]:
            rows = next(draws)
            shown = np.stack([question_images(questions, row, settings.size) for row in rows])
            images, answers = permuted(torch.from_numpy(shown), right[rows], settings.seed, number)
            loss = kind.loss(state.network(images.to(where)), answers.to(where))
            yield Loss(loss, {"loss": loss})

        fit(folder, method, state, losses, _rate, every=EVERY, progress=progress)
        share = accuracy(
            state.network, Path(data).with_name(VALIDATION), settings.size, card.answers
        )
        if share is not None:
            progress(settings.iterations, settings.iterations, {f"accuracy on {VALIDATION}": share})
        state.card = replace(state.card, validation=share)
        save_weights(folder / WEIGHTS, method, state.network, state.card)
    return folder / WEIGHTS


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
