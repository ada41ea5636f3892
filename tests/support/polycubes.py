"""Shapes of cubes for tests: so many random ones, and how two of them are congruent."""

import numpy as np
from scipy.spatial.transform import Rotation

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


def turns_between(a: np.ndarray, b: np.ndarray) -> list[Rotation]:
    """Return SciPy's rotations of the cube that take a shape to another one."""
    one, other = (2 * c.astype(int) - c.min(axis=0) - c.max(axis=0) for c in (a, b))
    expected = sorted(other.tolist())
    group = Rotation.create_group("O")
    return [turn for turn in group if sorted(np.rint(turn.apply(one)).tolist()) == expected]
