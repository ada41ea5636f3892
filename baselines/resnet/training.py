"""Training on labelled questions: each iteration takes one step on one batch.

Everything random in an iteration derives from the seed and the iteration's number, so that training
goes on after a kill as if it had never stopped.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.utils.data import DataLoader, Dataset

from baselines import checkpoints
from baselines.pix2shape.data.rooms import Draws, check_reducible
from baselines.pix2shape.use.predict import chosen_device
from baselines.resnet.answering import accuracy, images_of
from baselines.resnet.methods import Card, Method, State
from iqtt.files.reader import QuestionsDataset, open_questions, parts
from scenegen.common.errors import SceneGenError, SpecError
from scenegen.common.random.seeding import Purpose, item_rng
from scenegen.common.records import check

LABELED = "labeled"  # the part of a training file whose answers are told
VALIDATION = "iqtt-val.h5"
EVERY = 100  # iterations between checkpoints
Progress = Callable[[int, int, Mapping[str, float]], Any]


class LabelledQuestions(Dataset[tuple[Tensor, int]]):
    """The first labelled questions of a training file: images and the right answer of each."""

    def __init__(self, path: str | Path, size: int, labels: int | None = None) -> None:
        """Check the file.

        Args:
            size: pixels a side to which images are reduced.
            labels: how many answers may be used; None for all.

        Raises OSError, FileFormatError as `QuestionsFile`; SpecError where there are no labelled
        questions, or fewer than `labels`.
        """
        if LABELED not in parts(path):
            expected = "a training file with labelled questions, such as iqtt-train.h5"
            raise SpecError(path, "no training questions", expected)
        with open_questions(path, LABELED) as questions:
            if not len(questions) or not questions.has_answers:
                hint = "`iqtt make-split --labeled N` makes some"
                raise SpecError(path, "no labelled questions", "at least one", hint)
            labels = len(questions) if labels is None else labels
            check(1 <= labels <= len(questions), "labels", labels, f"1 to {len(questions)}")
            check_reducible(path, questions.height, questions.width, size)
            self.answers = questions.answers
        self._rows = QuestionsDataset(path, LABELED, ("questions", "answers"))
        self.fingerprint = str(self._rows.fingerprint or "")
        self._size, self._labels = size, labels

    def __len__(self) -> int:
        return self._labels

    def __getitem__(self, row: int) -> tuple[Tensor, int]:
        """Return images, (1 + K, 3, S, S), and the right answer, 0 to K - 1."""
        stored = self._rows[row]
        return images_of(stored["questions"], self._size), int(stored["answers"])


@checkpoints.one_at_a_time
def train(
    method: Method,
    data: str | Path,
    run_folder: str | Path,
    *,
    labels: int | None = None,
    seed: int = 0,
    iterations: int = 400,
    depth: int = 18,
    width: int = 16,
    size: int = 64,
    batch: int = 16,
    learning_rate: float = 0.001,
    device: str = "auto",
    resume: bool = False,
    progress: Progress = lambda done, total, numbers: None,
) -> Path:
    """Train on the labelled questions of a file; return the path of the weights.

    Args:
        run_folder: gets checkpoints, and the weights at the end.
        labels: how many of the labelled questions to use, the first ones; None for all.
        device: "auto", "cpu" or "cuda".
        resume: whether to go on from the folder's checkpoint, with the run's own settings.
        progress: called after each iteration with its number, how many there will be, and the loss;
            once more at the end, with the accuracy on iqtt-val.h5 if it lies beside `data`.

    The other settings are those of `Card`.

    Raises SpecError for settings or data that do not fit; FileExistsError where a new run finds a
    checkpoint; SceneGenError where the loss is not finite; OSError, FileFormatError.
    """
    folder = Path(run_folder)
    if resume:
        state = checkpoints.load_checkpoint(folder, method.recipe)
        source = LabelledQuestions(data, state.card.size, state.card.labels)
        checkpoints.check_data(data, source.fingerprint, state.card.fingerprint)
    else:
        checkpoints.check_new(folder)
        given = Card(
            method.name,
            answers=2,
            labels=1 if labels is None else labels,
            seed=seed,
            depth=depth,
            width=width,
            size=size,
            batch=batch,
            iterations=iterations,
            learning_rate=learning_rate,
        )
        source = LabelledQuestions(data, size, labels)
        mark = source.fingerprint
        card = replace(given, answers=source.answers, labels=len(source), fingerprint=mark)
        state = checkpoints.new_state(method.recipe, card)
    _to_device(state, chosen_device(device))
    last = state.card.iterations
    for loss in _steps(method, state, source):
        if state.card.iteration % EVERY == 0:
            checkpoints.save_checkpoint(folder, state)
        progress(state.card.iteration, last, {"loss": loss})
    beside = Path(data).with_name(VALIDATION)
    if beside.is_file():
        share = accuracy(state.network, beside, state.card.size, state.card.answers)
        state.card = replace(state.card, validation=share)
        if share is not None:
            progress(last, last, {f"accuracy on {VALIDATION}": share})
    checkpoints.save_weights(folder / checkpoints.WEIGHTS, state)
    checkpoints.save_checkpoint(folder, state)
    return folder / checkpoints.WEIGHTS


def _to_device(state: State, device: torch.device) -> None:
    state.network.to(device)
    state.optimiser.load_state_dict(state.optimiser.state_dict())  # moves its moments, too


def _steps(method: Method, state: State, source: LabelledQuestions) -> Iterator[float]:
    """Take the steps that are left; yield the loss of each."""
    card = state.card
    draws = Draws(len(source), card.batch, card.seed, card.iteration)
    batches = iter(DataLoader(source, batch_sampler=draws))
    device = next(state.network.parameters()).device
    state.network.train()
    for number in range(card.iteration, card.iterations):
        images, right = next(batches)
        images, right = permuted(images, right, card.seed, number)
        for group in state.optimiser.param_groups:
            group["lr"] = card.learning_rate * (1 - number / card.iterations)
        loss = method.loss(state.network(images.to(device)), right.to(device))
        if not torch.isfinite(loss):
            hint = "begin again with a smaller learning rate"
            raise SceneGenError(f"iteration {number}", "a loss that is not finite", hint=hint)
        state.optimiser.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        state.optimiser.step()
        state.card = replace(state.card, iteration=number + 1)
        yield float(loss.detach())


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
