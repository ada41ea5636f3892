"""How the network learns: from true depth of the pictures of training questions.

Every picture is an example of its own. Which pictures belong to a question, and which answer is
right, is not read.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from baselines.depth_match.network import METHOD, Card, Settings, answers_of, channels, symmetric
from baselines.relief.network import UNet
from baselines.relief.training import learning_rate, shape_loss
from baselines.training.baseline import Baseline, Lesson, Run
from baselines.training.checkpoint import State
from baselines.training.data import requests
from baselines.training.fit import Loss
from baselines.training.images import Array, Draws, check_reducible
from baselines.training.questions import UNLABELED, check_truth, question_images
from iqtt import QuestionsFile
from scenegen.common.errors import SpecError
from scenegen.common.random.seeding import Purpose, item_rng


@dataclass(frozen=True, eq=False)
class Pictures:
    """Square roots of radiance, (N, 3, S, S), and heights, (N, S, S), NaN on the background."""

    image: Tensor
    height: Tensor


def lesson(run: Run) -> Lesson:
    """Return what a run learns: the unlabelled questions of files with depth.

    The loss is the mean absolute error of height, plus `shape_loss` of each whole shape. Pictures
    are shown turned and mirrored.
    """
    files = run.data.questions(UNLABELED)
    pictures = read_pictures(files, run.settings.size)
    card = Card("depth-match", run.settings, **requests(files))
    return Lesson(card, partial(batches_of, pictures, run.settings), _loss, learning_rate)


def _loss(state: State[Card, UNet], batch: Pictures, number: int) -> Loss:
    seed = state.card.settings.seed
    form = int(item_rng(seed, number, Purpose.TRAINING).integers(8))
    image, height = (symmetric(maps.float(), form) for maps in (batch.image, batch.height))
    shown = height.isfinite()
    errors = torch.where(shown, state.network.relief(channels(image)) - height, 0)
    off = errors.abs().sum() / shown.sum().clamp(min=1)
    return Loss(off + shape_loss(errors, shown.int()), {"error of depth": off})


def batches_of(pictures: Pictures, settings: Settings, first: int) -> Iterator[Pictures]:
    """Yield the batches of iteration `first` and of those after it, without end."""
    for drawn in Draws(len(pictures.image), settings.batch, settings.seed, first):
        rows = torch.tensor(drawn)
        yield Pictures(pictures.image[rows], pictures.height[rows])


def read_pictures(files: Sequence[QuestionsFile], size: int) -> Pictures:
    """Read all pictures of questions, reduced to size x size pixels.

    Raises SpecError where a file tells no depth, or images cannot be reduced; FileFormatError.
    """
    parts: list[tuple[Array, Array]] = []
    for questions in files:
        check_truth(questions)
        check_reducible(questions.path, questions.height, questions.width, size)
        if "depth" not in questions.fields:
            hint = "`iqtt make-split --with-depth` writes it"
            raise SpecError(questions.path, "no depth", "the column `depth`", hint)
        count, views = len(questions), 1 + questions.answers
        image = np.empty((count, views, 3, size, size), np.float16)
        height = np.empty((count, views, size, size), np.float16)
        for row in range(count):
            image[row] = np.sqrt(question_images(questions, row, size).clip(min=0))
            distance = float(questions.read("camera_distance", row))
            height[row] = 1 - depth_medians(questions.read("depth", row), size) / distance
        parts.append((image.reshape(-1, 3, size, size), height.reshape(-1, size, size)))
    return Pictures(*(torch.from_numpy(np.concatenate(part)) for part in zip(*parts, strict=True)))


def depth_medians(depth: Array, size: int) -> Array:
    """Return the lower medians of square blocks: (N, H, W) -> (N, S, S), NaN where most are."""
    count, block = len(depth), depth.shape[1] // size
    blocks = depth.reshape(count, size, block, size, block).swapaxes(2, 3)
    ordered = np.sort(blocks.reshape(count, size, size, block * block), axis=-1)  # NaN comes last
    return np.asarray(ordered[..., (block * block - 1) // 2])


BASELINE = Baseline(
    METHOD,
    Settings,
    Path(__file__).with_name("files"),
    lesson,
    answers=answers_of,
)
