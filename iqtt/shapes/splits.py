"""Which split a shape belongs to, for ever: no class of shapes is ever in two splits.

A class is a shape and its mirror image. Its split follows from the class alone, whatever the seed,
the kind of shapes or questions, the radius and the preset. So a model that was trained on one
split has met no shape of any test set that was ever made with these rules.

The hash of a class is the first 8 bytes of SHA-256("3D-IQTT split " + id), where the id is that of
`canonical_class`. Chains are ranked by it among the chains of as many cubes, and shapes that branch
among those that branch, and each ranking is cut into three equal shares. Where the shapes of a
ranking are too many to list, the hash itself is cut: its first third is training.
"""

import functools
import hashlib

import numpy as np
from numpy.typing import NDArray

from iqtt.shapes.chains_and_trees import Kind, all_classes, check_request, distinct, random_shapes
from iqtt.shapes.near import is_chain
from iqtt.shapes.polycube import bounding_radius, canonical_class, set_ids
from scenegen.common.errors import SceneGenError

LISTED_CUBES: dict[Kind, int] = {"chain": 11, "tree": 9}
"""Up to so many cubes all classes are listed, in about a second; beyond, they are drawn."""
TAG = b"3D-IQTT split "
SHARES = 3  # training, validation and test

_TRIES_PER_CLASS, _MOST_AT_ONCE = 60, 65_536


class TooFewShapesError(SceneGenError):
    """There are not enough shapes of so many cubes for what was asked."""


def split_of(classes: NDArray[np.int8], chains: bool = False) -> NDArray[np.intp]:
    """Return the split that each class belongs to, (S,): 0 training, 1 validation, 2 test.

    Args:
        classes: (S, cubes, 3), as `canonical_class` gives them.
        chains: whether all of them are known to be chains, which saves the time to find out.
    """
    hashes, cubes = _hashes(classes), classes.shape[1]
    branching = np.zeros(len(classes), np.bool_) if chains else ~is_chain(classes)
    split = np.empty(len(classes), np.intp)
    for kind, rows in (("chain", ~branching), ("branching", branching)):
        if rows.any():
            split[rows] = np.searchsorted(_borders(cubes, kind), hashes[rows], side="right")
    return split


def split_classes(
    rng: np.random.Generator,
    cubes: int,
    kind: Kind = "chain",
    max_radius: float = np.inf,
    most: int = 20_000,
) -> tuple[NDArray[np.int8], ...]:
    """Return shape classes of training, validation and test, (size, cubes, 3) int8 each.

    Up to `LISTED_CUBES` these are all classes there are; the generator is not asked. Beyond, they
    are at most `most` of each split, drawn by `random_shapes`, repeats dropped, in 60 tries for
    each. They come as `canonical_class` gives them. This form shows always the same of the two
    mirror images: mirror half of the shapes that are shown, else a reference and its mirror image
    could be told apart by handedness alone.

    Args:
        max_radius: shapes whose `bounding_radius` (cube edges) is larger are left out.

    Raises ValueError as `check_request`.
    """
    check_request(cubes, kind)
    if cubes <= LISTED_CUBES[kind]:
        pool = known_classes(cubes, kind, max_radius)
        split = split_of(pool, kind == "chain")
        return tuple(pool[split == i] for i in range(SHARES))
    pool, split = np.zeros((0, cubes, 3), np.int8), np.zeros(0, np.intp)
    batch = min(10 * most, _MOST_AT_ONCE)
    for _ in range(-(-_TRIES_PER_CLASS * most // batch)):
        drawn = _within(random_shapes(rng, batch, cubes, kind), max_radius)
        pool = distinct(np.concatenate([pool, canonical_class(drawn)]))
        split = split_of(pool, kind == "chain")
        if np.bincount(split, minlength=SHARES).min() >= most:
            break
    return tuple(rng.permutation(pool[split == i])[:most] for i in range(SHARES))


def known_classes(cubes: int, kind: Kind = "chain", max_radius: float = np.inf) -> NDArray[np.int8]:
    """Return all classes within a radius, (S, cubes, 3) int8: what splits can share.

    Raises ValueError as `check_request`, and for more than `LISTED_CUBES` cubes.
    """
    check_request(cubes, kind)
    if cubes > LISTED_CUBES[kind]:
        raise ValueError(f"{kind} shapes of more than {LISTED_CUBES[kind]} cubes are not listed")
    return _within(_listed(cubes, kind), max_radius)


_listed = functools.cache(all_classes)  # shared, so it must not be handed out: `_within` copies


@functools.cache
def _borders(cubes: int, kind: str) -> NDArray[np.uint64]:
    """Return the hashes at which validation and test begin, (2,), for "chain" or "branching"."""
    shares = np.arange(1, SHARES)
    if cubes > LISTED_CUBES["chain" if kind == "chain" else "tree"]:
        return np.array([int(i) * 2**64 // SHARES for i in shares], np.uint64)
    if kind == "chain":
        classes = _listed(cubes, "chain")
    else:
        classes = _listed(cubes, "tree")
        classes = classes[~is_chain(classes)]
    ranked = np.append(np.sort(_hashes(classes)), np.uint64(2**64 - 1))
    return ranked[len(classes) * shares // SHARES]


def _hashes(classes: NDArray[np.int8]) -> NDArray[np.uint64]:
    """Return the hash of each class, (S,), the same on every machine."""
    digests = [hashlib.sha256(TAG + bytes(name)).digest()[:8] for name in set_ids(classes)]
    return np.frombuffer(b"".join(digests), ">u8").astype(np.uint64)


def _within(shapes: NDArray[np.int8], max_radius: float) -> NDArray[np.int8]:
    return shapes[bounding_radius(shapes) <= max_radius]
