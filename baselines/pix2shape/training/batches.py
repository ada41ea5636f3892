"""The batches that training reads, each determined by its number alone.

So training can go on where it was stopped, and every process can take its share of a batch.
"""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import torch
from lightning_fabric import Fabric
from torch import Tensor
from torch.utils.data import DataLoader, Dataset, default_collate

from baselines.pix2shape.data.questions import QuestionImages
from baselines.pix2shape.data.rooms import Batch, Draws, RoomImages
from baselines.pix2shape.network.config import ModelConfig
from baselines.pix2shape.network.shared_batch import LostProcessError, share
from baselines.pix2shape.training.state import State
from scenegen.common.errors import SceneGenError

Source = RoomImages | QuestionImages
LABELS_PER_PLACE = 100  # labels for each labelled question among those compared


def batch_size(config: ModelConfig, source: Source) -> int:
    """Return how many items a batch has: images of rooms, or questions."""
    return config.reconstructed_questions if isinstance(source, QuestionImages) else config.batch


def question_sizes(config: ModelConfig, source: Source, labels: int) -> tuple[int, int]:
    """Return how many questions with and without a label are compared in each iteration."""
    compared = config.contrast or config.questions or config.swap
    if not isinstance(source, QuestionImages) or not compared:
        return 0, 0
    if config.labelled_batch:
        labelled = config.labelled_batch if labels else 0
        return labelled, config.question_batch if config.contrast else 0
    if not config.contrast:
        return (config.question_batch if labels else 0), 0
    few = -(-labels // LABELS_PER_PLACE)  # more would repeat few labels too often
    labelled = min(few, config.question_batch // 4)
    return labelled, config.question_batch - labelled


class _Told(Dataset[Any]):
    """A source that returns errors; raised in a worker, they would come as a whole traceback."""

    def __init__(self, source: Source) -> None:
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
    """Raise LostProcessError where a process that reads data for the block ended, as if killed.

    torch tells of it in a signal handler, which may interrupt the block anywhere.
    """
    try:
        yield
    except RuntimeError as error:
        ended = re.search(r"DataLoader worker .*(killed by signal|exited unexpectedly)", str(error))
        if not ended:
            raise
        found = "that a process that reads the data ended, for want of memory perhaps"
        hint = "`--resume` goes on from a checkpoint; `--workers 0` needs no such processes"
        raise LostProcessError("training", found, hint=hint) from error


def _loaded(
    source: Source,
    rows: int,
    size: int,
    own: slice,
    first: int,
    seed: int,
    fabric: Fabric,
    workers: int,
) -> Iterator[dict[str, Tensor]]:
    """Yield batch after batch without end, beginning with batch `first`.

    Args:
        own: which rows of every batch are this process's.
    """
    loader = DataLoader(
        _Told(source),
        batch_sampler=Draws(rows, size, seed, first, own),
        num_workers=workers,
        collate_fn=_collated,
        pin_memory=fabric.device.type == "cuda",
    )
    for items in loader:
        if isinstance(items, Exception):
            raise items
        yield items


def image_batches(source: Source, fabric: Fabric, state: State, workers: int) -> Iterator[Batch]:
    """Yield batches of images without end, beginning with the state's iteration.

    Where no loss is of them, they are for pictures, and every process gets them whole.
    """
    config = state.model.config
    size = batch_size(config, source)
    first = state.iteration * config.batches_per_iteration
    own = share(size) if config.uses_images else slice(None)
    where = own, first, config.seed, fabric
    for items in _loaded(source, len(source), size, *where, workers):
        yield source.as_batch(items).to(fabric.device)


def question_batches(
    source: Source,
    labelled: QuestionImages | None,
    labels: int,
    fabric: Fabric,
    state: State,
    workers: int,
) -> Iterator[tuple[Batch, Tensor]]:
    """Yield the questions whose codes are compared, and their answers.

    The answer is -1 for a question without a label. Of each batch, labelled questions first, this
    process gets its share, which may hold questions of one kind only.
    """
    config = state.model.config
    with_label, without = question_sizes(config, source, labels)
    own, where = share(with_label + without), (state.iteration, config.seed, fabric)
    known = slice(min(own.start, with_label), min(own.stop, with_label))
    others = slice(max(own.start - with_label, 0), max(own.stop - with_label, 0))
    streams = []
    if labelled is not None and known.start < known.stop:
        several = workers if config.labelled_batch else 0
        streams.append(_loaded(labelled, labels, with_label, known, *where, several))
    if others.start < others.stop:
        unknown = _loaded(source, len(source), without, others, *where, workers)
        streams.append(
            {**items, "answer": torch.full((len(items["image"]),), -1)} for items in unknown
        )
    for parts in zip(*streams, strict=False):
        items = {name: torch.cat([part[name] for part in parts]) for name in parts[0]}
        yield source.as_batch(items).to(fabric.device), items["answer"].to(fabric.device)
