"""A stream of random numbers that is read one number after another."""

from collections.abc import Sequence
from typing import TypeVar

import numpy as np

from scenegen.common.random.seeding import Purpose, item_numbers

T = TypeVar("T")
AT_ONCE = 256


class Draws:
    """The numbers of one item, purpose and attempt, in order; the same on every machine."""

    def __init__(self, seed: int, index: int, purpose: Purpose, attempt: int = 0) -> None:
        self._key = seed, index, purpose, attempt
        self._start = 0
        self._numbers: list[float] = []

    def unit(self) -> float:
        """Return a number uniform on [0, 1)."""
        if not self._numbers:
            found = item_numbers(*self._key, self._start, count=AT_ONCE)
            self._numbers = found.tolist()[::-1]
            self._start += AT_ONCE
        return self._numbers.pop()

    def span(self, low: float, high: float) -> float:
        """Return a number uniform on [low, high)."""
        return low + (high - low) * self.unit()

    def chance(self, share: float) -> bool:
        """Return True with this probability."""
        return self.unit() < share

    def count(self, low: int, high: int) -> int:
        """Return a whole number from low to high, each as likely."""
        return low + int(self.unit() * (high - low + 1))

    def pick(self, values: Sequence[T], weights: Sequence[float] | None = None) -> T:
        """Return one of the values, with these weights or each as likely."""
        if weights is None:
            return values[int(self.unit() * len(values))]
        ends = np.add.accumulate(weights)
        return values[int(np.searchsorted(ends, self.unit() * ends[-1], side="right"))]

    def shuffled(self, values: Sequence[T]) -> list[T]:
        """Return the values in a random order."""
        found = list(values)
        for i in range(len(found) - 1, 0, -1):
            j = int(self.unit() * (i + 1))
            found[i], found[j] = found[j], found[i]
        return found
