"""Images and answers of questions, read from an open file and checked."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from baselines.training.images import Array, channels_first, check_reducible, row_batches
from iqtt import QuestionsFile, open_questions
from iqtt.files.reader import PARTS, holds_questions
from scenegen.common.errors import FileFormatError, SpecError
from scenegen.files.sets.shards import OpenFile
from scenegen.rendering.ground_truth import decode_image

LABELED, UNLABELED = PARTS
Progress = Callable[[int, int], Any]  # questions done since the last call, in all


def is_question_file(path: str | Path) -> bool:
    """Return whether a file holds questions or their answers. Raises OSError, FileFormatError."""
    with OpenFile(path, "rooms or question file") as opened:
        return holds_questions(opened)


def open_test(path: str | Path, size: int) -> QuestionsFile:
    """Open questions to answer, whose images can be reduced to a size.

    Raises as `open_questions`, and SpecError for training questions, none, and other images.
    """
    try:
        questions = open_questions(path)
    except SpecError as error:
        expected = "questions to predict, such as iqtt-test.h5"
        raise SpecError(path, "training questions", expected) from error
    try:
        check_reducible(path, questions.height, questions.width, size)
        if not len(questions):
            raise SpecError(path, "no questions", "one or more to predict")
    except BaseException:
        questions.close()
        raise
    return questions


def check_labels(labelled: QuestionsFile, labels: int, least: int = 0) -> None:
    """Raise SpecError unless a file tells the answers of as many questions."""
    count = len(labelled) if labelled.has_answers else 0
    if not least <= labels <= count:
        expected = f"{least} to {count}, the number of labels in {labelled.path}"
        raise SpecError("labels", labels, expected, "`iqtt make-split --labeled N` makes more")


def check_truth(questions: QuestionsFile) -> None:
    """Raise SpecError unless a file of ours holds questions and tells shapes, views and lights."""
    if questions.spec is None or not questions.has_truth or not len(questions):
        truth = "with" if questions.has_truth else "without"
        message = f"{len(questions)} questions {truth} the group `truth`"
        expected = "questions with that group, which holds shapes and lights"
        raise SpecError(questions.path, message, expected, "`iqtt make-split` writes it")


def question_images(questions: QuestionsFile, row: int, size: int) -> Array:
    """Return the images of a question as networks take them, (1 + K, 3, S, S), reference first."""
    where = f"{questions.path}: row {row}"
    stored = decode_image(questions.read("questions", row))
    return np.stack([channels_first(image, size, where) for image in stored])


def question_lights(questions: QuestionsFile, count: int) -> tuple[Array, Array]:
    """Return places and colours of the lights of the first questions, (Q, 1 + K, L, 3) each.

    Lengths of a question are scaled so that every camera has the distance that the spec's has. No
    image changes by that, as lights are made brighter by the square of the scale.

    Raises FileFormatError for a number that is not finite.
    """
    spec = questions.cube_spec
    assert spec is not None, "check_truth asks for it"
    rows = slice(0, count)
    scale = spec.camera_distance / questions.read("camera_distance", rows)
    scale = scale[:, None, None, None]
    lights = {"light_position": scale, "light_color": scale**2}
    for name, factor in lights.items():
        lights[name] = questions.read(name, rows) * factor
        wrong = ~np.isfinite(lights[name]).all(axis=(1, 2, 3))
        if wrong.any():
            where = f"{questions.path}: row {np.flatnonzero(wrong)[0]}"
            raise FileFormatError(where, f"{name} that is not finite", "finite numbers")
    return lights["light_position"], lights["light_color"]


@torch.no_grad()
def each_question(
    questions: QuestionsFile,
    size: int,
    function: Callable[[Tensor], Tensor],
    batch: int,
    count: int | None = None,
    progress: Progress = lambda done, total: None,
) -> Tensor:
    """Return a function of the images of each of the first questions, on the CPU.

    Args:
        function: of images, (B, 1 + K, 3, S, S), to values, (B, ...).
        count: how many questions; None for all.

    Raises FileFormatError where an image is damaged, not finite or huge.
    """
    total, values = len(questions) if count is None else count, []
    for rows in row_batches(total, batch):
        images = np.stack([question_images(questions, int(row), size) for row in rows])
        values.append(function(torch.from_numpy(images)).cpu())
        progress(len(rows), total)
    return torch.cat(values)


def training_answers(labelled: QuestionsFile, labels: int) -> Tensor:
    """Return which answers are right, of the first labelled questions, (labels,)."""
    return torch.from_numpy(labelled.read("answers", slice(0, labels)).astype(np.int64))
