"""Images as networks take them, and the rows of batch after batch.

Radiance is linear and images are square, of a multiple of the networks' size.
"""

import itertools
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import fields, is_dataclass, replace
from typing import Any, TypeVar

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.utils.data import Sampler

from scenegen.common.errors import FileFormatError, SpecError
from scenegen.common.random.seeding import Purpose, item_rng

Array = NDArray[Any]
T = TypeVar("T")
AHEAD = 3  # batches that are read while a GPU learns from another one
BRIGHTEST = 65504.0  # radiance; the largest finite number of float16, in which images may be stored


def check_reducible(where: object, height: int, width: int, size: int) -> None:
    """Raise SpecError unless images of a size can be reduced to size x size."""
    if height != width or height % size:
        expected = f"squares of a multiple of {size} pixels, the size that the networks take"
        raise SpecError(where, f"images of {height}x{width}", expected)


def reduced(image: Array, size: int) -> Array:
    """Return the means of square blocks: (H, W, ...) -> (S, S, ...).

    Whole images are added, which gives the bits of numpy's mean over the axes of blocks in less
    than a quarter of its time.
    """
    block = image.shape[0] // size
    total = np.zeros((size, size, *image.shape[2:]), np.result_type(image.dtype, np.float32))
    for i in range(block):
        for j in range(block):
            total += image[i::block, j::block]
    return np.asarray(total / total.dtype.type(block * block))


def channels_first(radiance: Array, size: int, where: object = "image") -> Array:
    """Return an image as the networks take it, float32: (H, W, 3) -> (3, S, S).

    Raises FileFormatError, which names `where`, unless all radiance is finite and not huge: what is
    not would crash networks, or come out as a depth that looks like any other.
    """
    small = reduced(radiance, size)
    if not max(abs(small.min()), abs(small.max())) <= BRIGHTEST:  # NaN is not
        expected = f"finite numbers of at most {BRIGHTEST:g}"
        raise FileFormatError(where, "radiance that is not finite, or huge", expected)
    return np.ascontiguousarray(np.moveaxis(small, -1, 0), dtype=np.float32)


def row_batches(count: int, size: int) -> Iterator[Array]:
    """Yield the numbers 0 to count - 1 in batches of a size, of which the last may be smaller."""
    return (np.arange(first, min(first + size, count)) for first in range(0, count, size))


class Draws(Sampler[list[int]]):
    """Rows of batch after batch without end; every epoch goes through all rows in a new order.

    The rows of a batch depend on its number alone, so that training can go on where it stopped.
    """

    def __init__(self, rows: int, batch: int, seed: int, first: int = 0) -> None:
        """Begin with batch `first`."""
        self._rows, self._batch, self._seed, self._first = rows, batch, seed, first

    def __iter__(self) -> Iterator[list[int]]:
        epoch, order = -1, np.empty(0, int)
        for number in itertools.count(self._first):
            rows: list[int] = []
            for place in range(number * self._batch, (number + 1) * self._batch):
                if place // self._rows != epoch:
                    epoch = place // self._rows
                    order = item_rng(self._seed, epoch, Purpose.ORDER).permutation(self._rows)
                rows.append(int(order[place % self._rows]))
            yield rows


def mapped(record: T, function: Callable[[Tensor], Tensor]) -> T:
    """Return a dataclass with a function applied to its tensors, nested dataclasses included."""
    changed: dict[str, Any] = {}
    for field in fields(record):  # type: ignore[arg-type]
        value = getattr(record, field.name)
        if isinstance(value, Tensor):
            changed[field.name] = function(value)
        elif is_dataclass(value):
            changed[field.name] = mapped(value, function)
    return replace(record, **changed)  # type: ignore[type-var]


def read_ahead(batches: Iterator[T], device: torch.device) -> Iterator[T]:
    """Yield batches, which are dataclasses, on a device.

    A thread reads and moves the next ones while a GPU learns. A CPU has no time to spare for that.
    """
    if device.type == "cpu":
        yield from batches
        return

    def read() -> T | None:
        batch = next(batches, None)
        return None if batch is None else mapped(batch, lambda values: values.to(device))

    with ThreadPoolExecutor(1) as reader:
        waiting = [reader.submit(read) for _ in range(AHEAD)]
        while (batch := waiting.pop(0).result()) is not None:
            waiting.append(reader.submit(read))
            yield batch
