"""The batches that training reads, each determined by its number alone.

So training can go on where it was stopped.
"""

import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import torch
from threadpoolctl import threadpool_limits
from torch import Tensor
from torch.utils.data import DataLoader, Dataset, default_collate

from baselines.pix2shape.images import Batch, QuestionImages, RoomImages
from baselines.pix2shape.network.config import ModelConfig
from baselines.training.fit import TrainingError
from baselines.training.images import Draws
from scenegen.common.errors import SceneGenError


@dataclass(frozen=True, eq=False)
class Sources:
    """What a run learns from.

    Attributes:
        images: of rooms, or of questions.
        labelled: questions whose first `labels` answers may be used; None if `labels` is 0.
    """

    images: RoomImages | QuestionImages
    labelled: QuestionImages | None = None
    labels: int = 0

    @property
    def fingerprint(self) -> str:
        """The fingerprint of rooms, or those of the parts of a question file that are used."""
        used = (self.images, self.labelled)
        return " ".join(str(source.fingerprint) for source in used if source is not None)

    def batch_size(self, config: ModelConfig) -> int:
        """Return how many items a batch of images has: rooms, or questions."""
        asks = isinstance(self.images, QuestionImages)
        return config.reconstructed_questions if asks else config.batch

    def question_sizes(self, config: ModelConfig) -> tuple[int, int]:
        """Return how many questions with and without a label are compared in each iteration."""
        compared = config.contrast or config.questions
        if not isinstance(self.images, QuestionImages) or not compared:
            return 0, 0
        if not config.contrast:
            return (config.question_batch if self.labels else 0), 0
        return (config.labelled_batch if self.labels else 0), config.question_batch


class _Catching(Dataset[Any]):
    """A source that returns errors; raised in a worker, they would come as a whole traceback."""

    def __init__(self, source: RoomImages | QuestionImages) -> None:
        self._source = source

    def __len__(self) -> int:
        return len(self._source)

    def __getitem__(self, row: int) -> Any:
        try:
            return self._source[row]
        except (SceneGenError, OSError) as error:
            return error


def _collated(items: list[Any]) -> Any:
    errors = [item for item in items if isinstance(item, Exception)]
    return errors[0] if errors else default_collate(items)


@contextmanager
def readers_kept() -> Iterator[None]:
    """Raise TrainingError where a process that reads data for the block ended, as if killed.

    torch tells of it in a signal handler, which may interrupt the block anywhere.
    """
    try:
        yield
    except RuntimeError as error:
        ended = re.search(r"DataLoader worker .*(killed by signal|exited unexpectedly)", str(error))
        if not ended:
            raise
        message = "that a data loading process exited, possibly out of memory"
        hint = "`--resume` continues from a checkpoint; `--workers 0` uses no such processes"
        raise TrainingError("training", message, hint=hint) from error


def image_batches(
    sources: Sources, config: ModelConfig, first: int, workers: int
) -> Iterator[Batch]:
    """Yield batches of images without end, beginning with those of iteration `first`.

    Where no loss is of them, they are for pictures.
    """
    source, size = sources.images, sources.batch_size(config)
    before = first * config.batches_per_iteration
    draws = Draws(len(source), size, config.seed, before)
    for items in _loaded(source, draws, workers):
        yield source.as_batch(items)


def question_batches(
    sources: Sources, config: ModelConfig, first: int, workers: int
) -> Iterator[tuple[Batch, Tensor]]:
    """Yield the questions whose codes are compared, and their answers, as `image_batches`.

    The answer is -1 for a question without a label; labelled questions come first.
    """
    source, labelled = sources.images, sources.labelled
    with_label, without = sources.question_sizes(config)
    streams = []
    if labelled is not None and with_label:
        draws = Draws(sources.labels, with_label, config.seed, first)
        streams.append(_loaded(labelled, draws, workers if config.labelled_batch else 0))
    if without:
        draws = Draws(len(source), without, config.seed, first)
        streams.append(
            {**items, "answer": torch.full((len(items["image"]),), -1)}
            for items in _loaded(source, draws, workers)
        )
    for parts in zip(*streams, strict=False):
        items = {name: torch.cat([part[name] for part in parts]) for name in parts[0]}
        yield source.as_batch(items), items["answer"]


def _use_one_thread(_worker: int) -> None:
    threadpool_limits(1)


def _loaded(
    source: RoomImages | QuestionImages, draws: Draws, workers: int
) -> Iterator[dict[str, Tensor]]:
    """Yield batch after batch without end, read by so many processes."""
    # A fork needs nothing of the caller's main module, whatever start method the caller chose.
    forks = "fork" if workers and sys.platform == "linux" else None
    loader = DataLoader(
        _Catching(source),
        batch_sampler=draws,
        num_workers=workers,
        collate_fn=_collated,
        multiprocessing_context=forks,
        worker_init_fn=_use_one_thread,
    )
    for items in loader:
        if isinstance(items, Exception):
            raise items
        yield items
