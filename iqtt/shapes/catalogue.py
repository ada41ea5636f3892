"""Which shape classes belong to which split: disjoint, deterministic, or refused with a reason.

A class is a shape and its mirror image. `make_catalogue` gives every split its own classes, and
settles for every other class too which split owns it, so that a distractor made later (one cube
moved, say) can be kept out of the splits that do not own it.
"""

import functools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from iqtt.shapes.polycube import Cubes, bounding_radius, canonical_class, is_chiral, set_ids
from iqtt.shapes.sampling import (
    Kind,
    TooFewShapesError,
    all_classes,
    check_request,
    distinct,
    propose,
)

EXACT_CUBES: dict[Kind, int] = {"chain": 11, "tree": 9}
"""Up to this many cubes all classes are listed, in about a second; beyond it they are drawn."""

_TRIES_PER_CLASS, _LEAST_TRIES, _MOST_AT_ONCE = 20, 20_000, 65_536


@dataclass(frozen=True, eq=False)
class Catalogue:
    """Shape classes of one number of cubes, assigned to splits; made by `make_catalogue`.

    :ivar splits: for each split its classes, (size, cubes, 3) int8, in random order, each in the
        form of `canonical_class`. That form always shows the same one of the two hands: mirror
        half of the shapes shown, or hand alone tells a reference from its mirror image.
    """

    splits: tuple[NDArray[np.int8], ...]
    _salt: int
    _first_ranks: NDArray[np.uint64]

    def owner(self, cubes: Cubes) -> NDArray[np.intp]:
        """The index of the split that owns each shape's class, (S,); mirror images share it.

        :param cubes: (S, cubes, 3), any shapes in any place and orientation.
        :raises ValueError: as `iqtt.shapes.polycube.canonical`.
        """
        return self.owner_of_classes(canonical_class(cubes))

    def owner_of_classes(self, classes: NDArray[np.int8]) -> NDArray[np.intp]:
        """As `owner`, of shapes that are in the form of `canonical_class` already."""
        return np.searchsorted(self._first_ranks, _ranks(classes, self._salt), side="right")


def make_catalogue(
    rng: np.random.Generator,
    cubes: int,
    sizes: Sequence[int],
    kind: Kind = "chain",
    max_radius: float = np.inf,
    chiral_only: bool = False,
) -> Catalogue:
    """Distinct shape classes for disjoint splits; the same generator state, the same catalogue.

    Up to `EXACT_CUBES` every class has the same chance. Beyond, classes are drawn as by
    `random_shapes`, repeats dropped. Classes in no split are owned in even shares, as far as that
    is possible.

    :param sizes: how many classes each split gets.
    :param max_radius: leave out shapes whose `bounding_radius` (cube edges) is larger.
    :param chiral_only: leave out shapes that a rotation takes to their mirror image.
    :raises ValueError: as `check_request`, or there are no sizes, or one is negative.
    :raises TooFewShapesError: so many classes do not exist, or were not found in 20 tries for each.
    """
    check_request(cubes, kind)
    if not sizes or min(sizes) < 0:
        raise ValueError(f"sizes must be one or more counts of 0 or more, not {list(sizes)}")
    wanted, limits = sum(sizes), _limits(max_radius, chiral_only)
    if cubes <= EXACT_CUBES[kind]:
        pool = known_classes(cubes, kind, max_radius, chiral_only)
        outcome = f"{len(pool):,} exist"
    else:
        pool, tries = _drawn(rng, wanted, cubes, kind, max_radius, chiral_only)
        outcome = f"{tries:,} tries found {len(pool):,}"
    if len(pool) < wanted:
        raise TooFewShapesError(
            f"asked for {wanted:,} distinct {kind} shapes of {cubes} cubes{limits}, mirror images "
            f"counted as one, but {outcome}: ask for fewer, take more cubes or loosen the limits"
        )
    salt = int(rng.integers(2**63))
    ranks = _ranks(pool, salt)
    order = np.argsort(ranks)
    share = (len(pool) - wanted) * np.arange(len(sizes)) // len(sizes)
    firsts = np.concatenate([[0], np.cumsum(sizes)[:-1]]) + share
    splits = tuple(pool[order[f : f + size]] for f, size in zip(firsts, sizes, strict=True))
    # Classes of equal rank on two sides of a border would break it: 64 bits make that a chance of
    # one in 10^13, and the audit would tell.
    bounded = np.append(ranks[order], np.uint64(2**64 - 1))
    return Catalogue(splits, salt, bounded[firsts[1:]])


def known_classes(
    cubes: int, kind: Kind = "chain", max_radius: float = np.inf, chiral_only: bool = False
) -> NDArray[np.int8]:
    """All classes within the limits, (S, cubes, 3) int8; its length is what splits can share.

    :raises ValueError: as `check_request`, or ``cubes`` is above `EXACT_CUBES`.
    """
    check_request(cubes, kind)
    if cubes > EXACT_CUBES[kind]:
        raise ValueError(f"{kind} shapes of more than {EXACT_CUBES[kind]} cubes are not listed")
    return _within(_listed(cubes, kind), max_radius, chiral_only)


def spread(total: int, supply: Sequence[int]) -> list[int]:
    """Divide a total as evenly as possible over supplies, taking no more than each has.

    :raises TooFewShapesError: the supplies together are smaller than the total.
    """
    counts, left = [0] * len(supply), total
    by_supply = sorted(range(len(supply)), key=supply.__getitem__)
    for place, i in enumerate(by_supply):
        counts[i] = min(supply[i], left // (len(supply) - place))
        left -= counts[i]
    if left:
        raise TooFewShapesError(
            f"asked for {total:,} distinct shapes, but {sum(supply):,} exist "
            f"({' + '.join(f'{count:,}' for count in supply)}): "
            "ask for fewer, take more cubes or loosen the limits"
        )
    return counts


_listed = functools.cache(all_classes)  # shared, so hand out copies only: `_within` makes them


def _drawn(
    rng: np.random.Generator, wanted: int, cubes: int, kind: Kind, max_radius: float, chiral: bool
) -> tuple[NDArray[np.int8], int]:
    """Distinct classes, as many as wanted or as bounded work finds, and the tries it took."""
    pool, tries = np.zeros((0, cubes, 3), dtype=np.int8), 0
    while len(pool) < wanted and tries < _TRIES_PER_CLASS * wanted + _LEAST_TRIES:
        batch = min(2 * (wanted - len(pool)) + 1000, _MOST_AT_ONCE)
        shapes = _within(propose(rng, batch, cubes, kind), max_radius, chiral)
        pool = distinct(np.concatenate([pool, canonical_class(shapes)]))
        tries += batch
    return pool, tries


def _within(shapes: NDArray[np.int8], max_radius: float, chiral_only: bool) -> NDArray[np.int8]:
    shapes = shapes[bounding_radius(shapes) <= max_radius]
    return shapes[is_chiral(shapes)] if chiral_only else shapes


def _limits(max_radius: float, chiral_only: bool) -> str:
    radius = f" within radius {max_radius:g}" if max_radius < np.inf else ""
    return radius + (" that differ from their mirror image" if chiral_only else "")


def _ranks(classes: NDArray[np.int8], salt: int) -> NDArray[np.uint64]:
    """A salted number for each class, (S,): an order by chance that any machine repeats.

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
