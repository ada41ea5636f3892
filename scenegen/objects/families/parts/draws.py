"""Random proportions and styles. Only uniform numbers are drawn, one after the other."""

from collections.abc import Sequence
from typing import TypeVar

import numpy as np

Option = TypeVar("Option")


def span(rng: np.random.Generator, low: float, high: float) -> float:
    """Draw a number between low and high."""
    return low + (high - low) * float(rng.random())


def pick(rng: np.random.Generator, options: Sequence[Option]) -> Option:
    """Draw one of the options, all as likely; repeat an option to make it likelier."""
    return options[int(rng.random() * len(options))]


def chance(rng: np.random.Generator, probability: float) -> bool:
    """Draw whether something with this probability is so."""
    return bool(rng.random() < probability)
