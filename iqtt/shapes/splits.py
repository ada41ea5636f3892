"""Which split a shape belongs to: training, validation and test share no class of shapes.

A class is a shape and its mirror image. `assign_classes` gives every split classes of its own. It
also settles which split owns each other class, so that a distractor that is made later (with one
cube moved, say) can be kept out of the splits that do not own it.
"""

import functools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from iqtt.shapes.chains_and_trees import Kind, all_classes, check_request, distinct, random_shapes
from iqtt.shapes.polycube import bounding_radius, canonical_class, set_ids
from scenegen.common.errors import SceneGenError

LISTED_CUBES: dict[Kind, int] = {"chain": 11, "tree": 9}
"""Up to so many cubes all classes are listed, in about a second; beyond, they are drawn."""

_TRIES_PER_CLASS, _LEAST_TRIES, _MOST_AT_ONCE = 20, 20_000, 65_536


class TooFewShapesError(SceneGenError):
    """There are not enough shapes of so many cubes for what was asked."""


@dataclass(frozen=True, eq=False)
class SplitClasses:
    """The shape classes of one number of cubes, assigned to splits by `assign_classes`.

    Attributes:
        splits: for each split its classes, (size, cubes, 3) int8, in random order, as
            `canonical_class` gives them. This form shows always the same of the two mirror images:
            mirror half of the shapes that are shown, else a reference and its mirror image could
            be told apart by handedness alone.
    """

    splits: tuple[NDArray[np.int8], ...]
    _salt: int
    _first_ranks: NDArray[np.uint64]

    def owner(self, classes: NDArray[np.int8]) -> NDArray[np.intp]:
        """Return the index of the split that owns each class, (S,).

        Args:
            classes: (S, cubes, 3), as `canonical_class` gives them.
        """
        return np.searchsorted(self._first_ranks, _ranks(classes, self._salt), side="right")


def assign_classes(
    rng: np.random.Generator,
    cubes: int,
    sizes: Sequence[int],
    kind: Kind = "chain",
    max_radius: float = np.inf,
) -> SplitClasses:
    """Draw distinct shape classes for disjoint splits; the same generator state, the same classes.

    Up to `LISTED_CUBES` every class is equally likely. Beyond, classes are drawn by
    `random_shapes`, repeats dropped. Classes in no split are owned in shares as even as possible.

    Args:
        sizes: how many classes each split gets.
        max_radius: shapes whose `bounding_radius` (cube edges) is larger are left out.

    Raises:
        ValueError: as `check_request`, or there are no sizes, or one is negative.
        TooFewShapesError: so many classes do not exist, or 20 tries for each did not find them.
    """
    check_request(cubes, kind)
    if not sizes or min(sizes) < 0:
        raise ValueError(f"sizes must be one or more counts of 0 or more, not {list(sizes)}")
    wanted = sum(sizes)
    if cubes <= LISTED_CUBES[kind]:
        pool, searched = known_classes(cubes, kind, max_radius), ""
    else:
        pool, tries = _drawn(rng, wanted, cubes, kind, max_radius)
        searched = f" in {tries:,} tries"
    if len(pool) < wanted:
        radius = f" within radius {max_radius:g}" if max_radius < np.inf else ""
        raise TooFewShapesError(
            f"{kind} shapes of {cubes} cubes{radius}, mirror images counted as one",
            f"{len(pool):,}{searched}",
            f"{wanted:,}",
            "ask for fewer, take more cubes or a larger radius",
        )
    salt = int(rng.integers(2**63))
    ranks = _ranks(pool, salt)
    order = np.argsort(ranks)
    share = (len(pool) - wanted) * np.arange(len(sizes)) // len(sizes)
    firsts = np.concatenate([[0], np.cumsum(sizes)[:-1]]) + share
    splits = tuple(pool[order[f : f + size]] for f, size in zip(firsts, sizes, strict=True))
    # Two classes of equal rank on two sides of a border would both belong to one split. With 64
    # bits that has a chance of one in 10^13, and the audit would find it.
    bounded = np.append(ranks[order], np.uint64(2**64 - 1))
    return SplitClasses(splits, salt, bounded[firsts[1:]])


def known_classes(cubes: int, kind: Kind = "chain", max_radius: float = np.inf) -> NDArray[np.int8]:
    """Return all classes within a radius, (S, cubes, 3) int8: what splits can share.

    Raises ValueError as `check_request`, and for more than `LISTED_CUBES` cubes.
    """
    check_request(cubes, kind)
    if cubes > LISTED_CUBES[kind]:
        raise ValueError(f"{kind} shapes of more than {LISTED_CUBES[kind]} cubes are not listed")
    return _within(_listed(cubes, kind), max_radius)


_listed = functools.cache(all_classes)  # shared, so it must not be handed out: `_within` copies


def _drawn(
    rng: np.random.Generator, wanted: int, cubes: int, kind: Kind, max_radius: float
) -> tuple[NDArray[np.int8], int]:
    """Return distinct classes, as many as wanted or as bounded work finds, and the tries."""
    pool, tries = np.zeros((0, cubes, 3), dtype=np.int8), 0
    while len(pool) < wanted and tries < _TRIES_PER_CLASS * wanted + _LEAST_TRIES:
        batch = min(2 * (wanted - len(pool)) + 1000, _MOST_AT_ONCE)
        shapes = _within(random_shapes(rng, batch, cubes, kind), max_radius)
        pool = distinct(np.concatenate([pool, canonical_class(shapes)]))
        tries += batch
    return pool, tries


def _within(shapes: NDArray[np.int8], max_radius: float) -> NDArray[np.int8]:
    return shapes[bounding_radius(shapes) <= max_radius]


def _ranks(classes: NDArray[np.int8], salt: int) -> NDArray[np.uint64]:
    """Return a salted number for each class, (S,): their order is random and machine-independent.

    It mixes the id with the steps of SplitMix64 (Steele, Lea & Flood, 2014).
    """
    words = set_ids(classes).view(">u8").reshape(len(classes), 4).astype(np.uint64)
    ranks = np.full(len(classes), salt, dtype=np.uint64)
    for word in words.T:
        ranks = (ranks ^ word) + np.uint64(0x9E3779B97F4A7C15)
        ranks = (ranks ^ (ranks >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        ranks = (ranks ^ (ranks >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        ranks ^= ranks >> np.uint64(31)
    return ranks
