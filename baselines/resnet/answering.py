"""Answers to questions, from their images alone: scores of a network, submissions, accuracy."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from baselines.checkpoints import load_weights
from baselines.pix2shape.data.rooms import channels_first, check_reducible
from baselines.pix2shape.use.predict import chosen_device
from baselines.resnet.methods import Method
from iqtt.files.reader import QuestionsFile, open_questions, parts
from metrics.prediction_writer import write_answers
from scenegen.common.errors import SpecError
from scenegen.files.new_file import check_writable
from scenegen.rendering.ground_truth import decode_image

Array = NDArray[Any]
BATCH = 32  # questions at a time
Progress = Callable[[int, int], Any]  # rows done since the last call, rows in all


def write_submission(
    method: Method,
    data: str | Path,
    out: str | Path,
    weights: str | Path | None = None,
    *,
    device: str = "auto",
    overwrite: bool = False,
    progress: Progress = lambda done, total: None,
) -> None:
    """Write answers to the questions of a file, and the score of each answer.

    Args:
        data: a file such as iqtt-test.h5; its answers are not read.
        weights: None for those that come with the package.
        device: "auto", "cpu" or "cuda".

    Raises OSError, FileFormatError, and SpecError where the weights do not suit the questions.
    """
    state = load_weights(_bundled(method) if weights is None else weights, method.recipe)
    network, card = state.network, state.card
    check_writable(Path(out), overwrite)
    if len(parts(data)) > 1:
        raise SpecError(data, "training questions", "questions to answer, such as iqtt-test.h5")
    with open_questions(data) as questions:
        count = questions.answers
        if count != card.answers and not method.any_number:
            raise SpecError(
                data,
                f"questions of {count} answers",
                f"{card.answers}, as those that {method.name} was trained on",
                f"its last layer has an output for each answer; train it on questions of {count}",
            )
        network.to(chosen_device(device))
        found = answer_scores(network, questions, card.size, progress)
    run = f"{card.labels} labels, seed {card.seed}"
    write_answers(out, data, method=method.name, scores=found, run=run, overwrite=overwrite)


def _bundled(method: Method) -> Path:
    """Return the weights that come with the package. Raises SpecError."""
    found = sorted(method.files.glob("*.safetensors"))
    if not found:
        hint = f"train some with `bench train {method.name}`"
        raise SpecError("weights", "none bundled", "a .safetensors file", hint)
    return found[-1]


@torch.inference_mode()
def answer_scores(
    network: nn.Module,
    questions: QuestionsFile,
    size: int,
    progress: Progress = lambda done, total: None,
) -> Array:
    """Return the score of each answer, (Q, K); the network is put in evaluation mode.

    Raises SpecError where the images cannot be reduced to `size` pixels a side.
    """
    check_reducible(questions.path, questions.height, questions.width, size)
    device, total = next(network.parameters()).device, len(questions)
    network.eval()
    scores = []
    for rows in _batches(total):
        images = torch.stack([images_of(questions.read("questions", row), size) for row in rows])
        scores.append(network(images.to(device)).cpu().double().numpy())
        progress(len(rows), total)
    return np.concatenate(scores) if scores else np.empty((0, questions.answers))


def images_of(stored: Array, size: int) -> Tensor:
    """Return the images of one question as a network takes them, (1 + K, 3, S, S)."""
    images = [channels_first(image, size) for image in decode_image(stored)]
    return torch.from_numpy(np.stack(images))


def accuracy(network: nn.Module, path: str | Path, size: int, answers: int) -> float | None:
    """Return the share of a file's questions that are answered right.

    None where the file has no questions of so many answers, or tells no answers.
    """
    with open_questions(path) as questions:
        if not len(questions) or not questions.has_answers or questions.answers != answers:
            return None
        found = answer_scores(network, questions, size).argmax(axis=1)
        return float((found == questions.read("answers", slice(None))).mean())


def _batches(count: int) -> Iterator[range]:
    return (range(first, min(first + BATCH, count)) for first in range(0, count, BATCH))
