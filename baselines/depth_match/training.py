"""How the network learns: from true depth of the pictures of training questions.

Every picture is an example of its own. Which pictures belong to a question, and which answer is
right, is not read.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import cast

import numpy as np
import torch
from torch import Tensor

from baselines.depth_match.network import METHOD, Card, Settings, channels, symmetric
from baselines.relief.training import learning_rate, shape_loss
from baselines.training.checkpoint import WEIGHTS
from baselines.training.data import TrainingFiles, requests
from baselines.training.fit import Loss, Progress, fit
from baselines.training.images import Array, Draws, check_reducible, read_ahead
from baselines.training.machine import Machine, chosen_device
from baselines.training.questions import UNLABELED, check_truth, question_images
from baselines.training.run_folder import alone_in, begun, earlier_state
from baselines.training.streams import TrainingStreams
from iqtt import QuestionsFile, SplitSpec
from scenegen.common.errors import SpecError
from scenegen.common.random.seeding import Purpose, item_rng


@dataclass(frozen=True, eq=False)
class Pictures:
    """Square roots of radiance, (N, 3, S, S), and heights, (N, S, S), NaN on the background."""

    image: Tensor
    height: Tensor


STREAMED = {"with_depth": True}  # settings of the questions of streams


def train(
    data: TrainingFiles | TrainingStreams,
    run_folder: str | Path,
    settings: Settings = Settings(),  # noqa: B008 (it is frozen)
    machine: Machine | None = None,
    *,
    resume: bool = False,
    progress: Progress = lambda done, total, losses: None,
) -> Path:
    """Train on the unlabelled questions of files with depth, or on streams.

    The arguments are those that `baselines.training` says.

    The loss is the mean absolute error of height, plus `shape_loss` of each whole shape. Pictures
    are shown turned and mirrored.
    """
    folder, machine = Path(run_folder), machine or Machine()
    device = chosen_device(machine.device)
    with alone_in(folder):
        earlier = earlier_state(folder, METHOD, resume)
        settings = settings if earlier is None else earlier.card.settings
        shown, each = None, 0
        if isinstance(data, TrainingStreams):
            shown = data.shown(settings.size, settings.seed, **STREAMED)
            each = -(-settings.batch // (1 + SplitSpec.answers))  # questions
            card = Card("depth-match", settings, **shown.card())
        else:
            files = data.questions(UNLABELED)
            pictures = read_pictures(files, settings.size)
            card = Card("depth-match", settings, **requests(files))
        state = begun(METHOD, card, earlier, data.where, device)
        at = state.card.iteration
        source: Iterator[Pictures]
        if shown:
            blocks = shown.blocks(at * each, each, machine.workers)
            source = (read_pictures([cast(QuestionsFile, b)], settings.size) for b in blocks)
        else:
            source = batches_of(pictures, settings, at)
        batches = read_ahead(source, device)

        def losses(number: int) -> Iterator[Loss]:
            batch = next(batches)
            form = int(item_rng(settings.seed, number, Purpose.TRAINING).integers(8))
            image, height = (symmetric(one.float(), form) for one in (batch.image, batch.height))
            shown = height.isfinite()
            errors = torch.where(shown, state.network.relief(channels(image)) - height, 0)
            off = errors.abs().sum() / shown.sum().clamp(min=1)
            yield Loss(off + shape_loss(errors, shown.int()), {"error of depth": off})

        fit(folder, METHOD, state, losses, learning_rate, machine, rows=each, progress=progress)
    return folder / WEIGHTS


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
    return Pictures(*(torch.from_numpy(np.concatenate(one)) for one in zip(*parts, strict=True)))


def depth_medians(depth: Array, size: int) -> Array:
    """Return the lower medians of square blocks: (N, H, W) -> (N, S, S), NaN where most are."""
    count, block = len(depth), depth.shape[1] // size
    blocks = depth.reshape(count, size, block, size, block).swapaxes(2, 3)
    ordered = np.sort(blocks.reshape(count, size, size, block * block), axis=-1)  # NaN comes last
    return np.asarray(ordered[..., (block * block - 1) // 2])
