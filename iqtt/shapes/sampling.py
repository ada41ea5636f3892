"""Random polycubes, and all of them: chains and branching shapes, many at a time.

A ``chain`` is a self-avoiding walk on the cubic lattice: each cube shares a face with the one
before it and no cell is entered twice. Cubes far apart along the chain may still touch, as in the
literature on such walks (Madras & Slade, "The Self-Avoiding Walk", 1993; OEIS A001412 counts
them). A ``tree`` grows cube by cube, each on a face of the shape so far, so it may branch.
"""

from collections.abc import Iterator
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from iqtt.shapes.polycube import MAX_CUBES, bounding_radius, canonical_class, set_ids
from scenegen.common.errors import SceneGenError

Kind: TypeAlias = Literal["chain", "tree"]

STEPS = np.array(
    [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], dtype=np.int8
)
"""The six face directions, (6, 3) int8; ``i ^ 1`` is opposite to ``i``."""

_TRIES_PER_SHAPE = 200  # a radius that refuses more than this is not worth waiting for
_BATCH = 65536  # tries at a time: bounds the memory


class TooFewShapesError(SceneGenError):
    """There are not enough shapes of this many cubes for what was asked."""


def check_request(cubes: int, kind: Kind) -> None:
    """Refuse what no shape can be.

    :raises ValueError: ``cubes`` is not 1 to ``MAX_CUBES``, or the kind is unknown.
    """
    if kind not in ("chain", "tree"):
        raise ValueError(f"kind is 'chain' or 'tree', not {kind!r}")
    if not 1 <= cubes <= MAX_CUBES:
        raise ValueError(f"a shape has 1 to {MAX_CUBES} cubes, not {cubes}")


def random_shapes(
    rng: np.random.Generator,
    count: int,
    cubes: int,
    kind: Kind = "chain",
    max_radius: float = np.inf,
) -> NDArray[np.int8]:
    """Independent random shapes, repeats included, as they were grown.

    Chains are uniform over self-avoiding walks of this length, their rows in walking order. Trees
    grow on a face chosen uniformly among those with a free cell in front.

    :param max_radius: refuse shapes whose `bounding_radius` (cube edges) is larger.
    :return: (count, cubes, 3) int8; the first cube is at the origin.
    :raises ValueError: as `check_request`.
    :raises TooFewShapesError: fewer than one try in 200 keeps within the radius.
    """
    kept, found, tries = [], 0, 0
    while found < count:
        if tries >= _TRIES_PER_SHAPE * max(count, 100):
            raise TooFewShapesError(
                f"asked for {count:,} random {kind} shapes of {cubes} cubes within radius "
                f"{max_radius:g}; {tries:,} tries gave {found:,}: "
                "allow a larger radius or take fewer cubes"
            )
        size = min(3 * (count - found) // 2 + 100, _BATCH)
        shapes = propose(rng, size, cubes, kind)
        kept.append(shapes[bounding_radius(shapes) <= max_radius])
        found, tries = found + len(kept[-1]), tries + size
    return np.concatenate([np.zeros((0, cubes, 3), np.int8), *kept])[:count]


def propose(
    rng: np.random.Generator, tries: int, cubes: int, kind: Kind = "chain"
) -> NDArray[np.int8]:
    """What is left of so many tries at a random shape, (at most tries, cubes, 3) int8.

    :raises ValueError: as `check_request`.
    """
    check_request(cubes, kind)
    return _walks(rng, tries, cubes) if kind == "chain" else _grown(rng, tries, cubes)


def _walks(rng: np.random.Generator, tries: int, cubes: int) -> NDArray[np.int8]:
    """Uniform walks that never turn straight back, less those that meet themselves.

    Refusing whole walks, never mending them, is what makes those left uniform; three in four
    walks of 11 cubes are left, and half of those of 16.
    """
    heading = rng.integers(6, size=(tries, cubes - 1), dtype=np.int8)
    for i in range(1, cubes - 1):
        # Five choices: all but the opposite of the step before.
        back = heading[:, i - 1] ^ 1
        choice = rng.integers(5, size=tries, dtype=np.int8)
        heading[:, i] = choice + (choice >= back)
    walks = np.zeros((tries, cubes, 3), dtype=np.int8)
    np.cumsum(STEPS[heading], axis=1, out=walks[:, 1:])
    cells = np.sort(_cells(walks), axis=1)
    avoids_itself = (cells[:, 1:] != cells[:, :-1]).all(axis=1)
    return np.asarray(walks[avoids_itself])


def _grown(rng: np.random.Generator, count: int, cubes: int) -> NDArray[np.int8]:
    """Shapes grown on uniformly chosen free faces, (count, cubes, 3)."""
    shapes = np.zeros((count, cubes, 3), dtype=np.int8)
    for size in range(1, cubes):
        waiting = np.arange(count)
        # Ends: at most MAX_CUBES cubes always show a good part of their faces, so each round
        # seats a good part of those that wait.
        while len(waiting):
            base = shapes[waiting, rng.integers(size, size=len(waiting))]
            cell = base + STEPS[rng.integers(6, size=len(waiting))]
            taken = (shapes[waiting, :size] == cell[:, None]).all(axis=2).any(axis=1)
            shapes[waiting[~taken], size] = cell[~taken]
            waiting = waiting[taken]
    return shapes


def all_classes(cubes: int, kind: Kind = "chain") -> NDArray[np.int8]:
    """Every shape of this many cubes, one of each class (a shape and its mirror image).

    The number of classes of trees is OEIS A038119. Work and memory grow about fivefold with each
    cube for chains, sevenfold for trees: see ``catalogue.EXACT_CUBES`` for what is quick.

    :return: (S, cubes, 3) int8 in the form of `canonical_class`, in the order of their ids.
    :raises ValueError: as `check_request`.
    """
    check_request(cubes, kind)
    if kind == "chain":
        return distinct(canonical_class(all_walks(cubes)))
    shapes = np.zeros((1, 1, 3), dtype=np.int8)
    for _ in range(1, cubes):
        shapes = distinct(np.concatenate([distinct(canonical_class(p)) for p in _one_more(shapes)]))
    return shapes


def all_walks(cubes: int) -> NDArray[np.int8]:
    """Every self-avoiding walk of this many cubes, one for each orbit of the 48 symmetries.

    The first step goes along +x, the first that leaves that line along +y, the first that leaves
    that plane along +z. A straight walk so stands for 6 walks, a flat one for 24, another for 48:
    together they make OEIS A001412.

    :return: (W, cubes, 3) int8, rows in walking order, the first at the origin.
    """
    walks, axes = np.zeros((1, 1, 3), dtype=np.int8), np.zeros(1, dtype=np.int64)
    for _ in range(1, cubes):
        open_steps = np.array([1, 3, 5, 6])[axes]  # of STEPS, by how many axes the walk has used
        rows, step = np.nonzero(np.arange(6) < open_steps[:, None])
        cell = walks[rows, -1] + STEPS[step]
        free = ~(walks[rows] == cell[:, None]).all(axis=2).any(axis=1)
        rows, step, cell = rows[free], step[free], cell[free]
        walks = np.concatenate([walks[rows], cell[:, None]], axis=1)
        axes = np.maximum(axes[rows], step // 2 + 1)
    return walks


def distinct(shapes: NDArray[np.int8]) -> NDArray[np.int8]:
    """The distinct sets of cubes, in the order of their ids; pass canonical forms."""
    _, first = np.unique(set_ids(shapes), return_index=True)
    return shapes[first]


def _one_more(shapes: NDArray[np.int8]) -> Iterator[NDArray[np.int8]]:
    """Every shape with a cube more on every free face, some of them repeatedly, by parts."""
    size = shapes.shape[1]
    for start in range(0, len(shapes), _BATCH // (6 * size)):
        part = shapes[start : start + _BATCH // (6 * size)]
        cells = (part[:, :, None] + STEPS).reshape(len(part), -1, 3)
        rows, face = np.nonzero(~(cells[:, :, None] == part[:, None]).all(axis=3).any(axis=2))
        yield np.concatenate([part[rows], cells[rows, face][:, None]], axis=1)


def _cells(shapes: NDArray[np.int8]) -> NDArray[np.int32]:
    """One number for each cube's cell, (S, n), equal for cubes of a shape in the same cell."""
    x, y, z = np.moveaxis(shapes.astype(np.int32), 2, 0)
    return np.asarray((x << 16) + (y << 8) + z)
