"""Random proportions and styles.

Each function takes exactly one uniform number from the generator, so that a family's sequence of
draws is easy to keep unchanged.
"""

from collections.abc import Sequence
from typing import TypeVar

import numpy as np

Option = TypeVar("Option")


def span(rng: np.random.Generator, low: float, high: float) -> float:
    """Draw a number, uniform between low and high."""
    return low + (high - low) * float(rng.random())


def pick(rng: np.random.Generator, options: Sequence[Option]) -> Option:
    """Draw one of the options, all equally likely; list an option twice to double its chance."""
    return options[int(rng.random() * len(options))]


def chance(rng: np.random.Generator, probability: float) -> bool:
    """Return True with this probability."""
    return bool(rng.random() < probability)
