"""Images as networks take them, and the rows of batch after batch.

Radiance is linear and images are square, of a multiple of the networks' size.
"""

import itertools
import os
from collections.abc import Callable, Iterator
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray
from torch.utils.data import Sampler

from scenegen.common.errors import FileFormatError, SpecError
from scenegen.common.random.seeding import Purpose, item_rng

Array = NDArray[Any]
FileT = TypeVar("FileT")
BRIGHTEST = 65504.0  # radiance; the largest finite number of float16, in which images may be stored


class Opened(Generic[FileT]):
    """A file that is open, and that other processes may read, too: each opens it for itself."""

    def __init__(self, opener: Callable[[], FileT]) -> None:
        """Open the file. `opener` can be pickled."""
        self._opener = opener
        self._files = {os.getpid(): opener()}

    @property
    def file(self) -> FileT:
        """The file as this process has it open."""
        if os.getpid() not in self._files:  # in a fork, HDF5 must not use its parent's file
            self._files[os.getpid()] = self._opener()
        return self._files[os.getpid()]

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_files": {}}


def check_reducible(where: object, height: int, width: int, size: int) -> None:
    """Raise SpecError unless images of a size can be reduced to size x size."""
    if height != width or height % size:
        expected = f"squares of a multiple of {size} pixels, the size that the networks take"
        raise SpecError(where, f"images of {height}x{width}", expected)


def reduced(image: Array, size: int) -> Array:
    """Return the means of square blocks: (H, W, ...) -> (S, S, ...)."""
    block = image.shape[0] // size
    blocks: Array = image.reshape(size, block, size, block, *image.shape[2:])
    means: Array = blocks.mean(axis=(1, 3))
    return means


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

    def __init__(
        self, rows: int, batch: int, seed: int, first: int = 0, share: slice = slice(None)
    ) -> None:
        """Begin with batch `first`; this process takes a `share` of the rows of every batch."""
        self._rows, self._batch, self._seed = rows, batch, seed
        self._first, self._share = first, share

    def __iter__(self) -> Iterator[list[int]]:
        epoch, order = -1, np.empty(0, int)
        for number in itertools.count(self._first):
            rows: list[int] = []
            for place in range(number * self._batch, (number + 1) * self._batch):
                if place // self._rows != epoch:
                    epoch = place // self._rows
                    order = item_rng(self._seed, epoch, Purpose.ORDER).permutation(self._rows)
                rows.append(int(order[place % self._rows]))
            yield rows[self._share]
