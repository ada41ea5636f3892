"""Shapes of cubes for tests: so many random ones, and whether two are congruent."""

import numpy as np

from iqtt.audit.congruence import congruent_rows
from iqtt.shapes.chains_and_trees import Kind, random_shapes


def some_shapes(
    rng: np.random.Generator, count: int, cubes: int, kind: Kind = "chain"
) -> np.ndarray:
    """Return exactly `count` random shapes, (count, cubes, 3) int8."""
    return random_shapes(rng, 3 * count + 20, cubes, kind)[:count]


def are_congruent(a: np.ndarray, b: np.ndarray) -> bool:
    """Return whether two shapes, (n, 3) and (m, 3), are congruent."""
    return len(a) == len(b) and bool(congruent_rows(a[None], b[None])[0])
