"""How the network learns: from true depth of the pictures of training questions.

Every picture is an example of its own. Which pictures belong to a question, and which answer is
right, is not read.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from baselines.depth_match.network import METHOD, Card, Settings, channels, symmetric
from baselines.relief.shape_loss import shape_loss
from baselines.relief.training import learning_rate
from baselines.training.checkpoint import WEIGHTS
from baselines.training.fit import Loss, Progress, fit
from baselines.training.images import Array, Draws, check_reducible
from baselines.training.questions import UNLABELED, check_truth, open_training, question_images
from baselines.training.run_folder import alone_in, begun, earlier_state
from iqtt import QuestionsFile
from scenegen.common.errors import SpecError
from scenegen.common.random.seeding import Purpose, item_rng

EVERY = 100  # iterations between checkpoints


@dataclass(frozen=True, eq=False)
class Pictures:
    """Square roots of radiance, (N, 3, S, S), and heights, (N, S, S), NaN on the background."""

    image: Tensor
    height: Tensor


def train(
    data: str | Path,
    run_folder: str | Path,
    settings: Settings = Settings(),  # noqa: B008 (it is frozen)
    *,
    resume: bool = False,
    progress: Progress = lambda done, total, losses: None,
) -> Path:
    """Train on the unlabelled questions of a file with depth, as `baselines.training` says.

    The loss is the mean absolute error of height, plus `shape_loss` of each whole shape. Pictures
    are shown turned and mirrored.
    """
    folder = Path(run_folder)
    with alone_in(folder), open_training(data, UNLABELED) as questions:
        earlier = earlier_state(folder, METHOD, resume)
        settings = settings if earlier is None else earlier.card.settings
        pictures = read_pictures(questions, settings.size)
        assert questions.spec is not None, "read_pictures asks for it"
        spec, mark = questions.spec.to_json(), str(questions.fingerprint)
        state = begun(
            METHOD, Card("depth-match", settings, data=spec, fingerprint=mark), earlier, data
        )
        count, at = len(pictures.image), state.card.iteration
        draws = iter(Draws(count, settings.batch, settings.seed, at))

        def losses(number: int) -> Iterator[Loss]:
            rows = torch.tensor(next(draws))
            form = int(item_rng(settings.seed, number, Purpose.TRAINING).integers(8))
            image = symmetric(pictures.image[rows].float(), form)
            height = symmetric(pictures.height[rows].float(), form)
            shown = height.isfinite()
            errors = torch.where(shown, state.network.relief(channels(image)) - height, 0)
            off = errors.abs().sum() / shown.sum().clamp(min=1)
            yield Loss(off + shape_loss(errors, shown.int()), {"error of depth": off})

        fit(folder, METHOD, state, losses, learning_rate, every=EVERY, progress=progress)
    return folder / WEIGHTS


def read_pictures(questions: QuestionsFile, size: int) -> Pictures:
    """Read all pictures of questions, reduced to size x size pixels.

    Raises SpecError where the file tells no depth, or images cannot be reduced; FileFormatError.
    """
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
        height[row] = 1 - block_medians(questions.read("depth", row), size) / distance
    return Pictures(*(torch.from_numpy(one).flatten(0, 1) for one in (image, height)))


def block_medians(depth: Array, size: int) -> Array:
    """Return the lower medians of square blocks: (N, H, W) -> (N, S, S), NaN where most are."""
    count, block = len(depth), depth.shape[1] // size
    blocks = depth.reshape(count, size, block, size, block).swapaxes(2, 3)
    ordered = np.sort(blocks.reshape(count, size, size, block * block), axis=-1)  # NaN comes last
    return np.asarray(ordered[..., (block * block - 1) // 2])
