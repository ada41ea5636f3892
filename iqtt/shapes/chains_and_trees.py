"""Chains and trees of cubes: draw random ones, and list all of a given number of cubes.

A chain is a self-avoiding walk on the cubic lattice: each cube shares a face with the one before
it, and no cell is entered twice. Cubes that are far apart along the chain may still touch, as usual
for such walks (Madras & Slade, "The Self-Avoiding Walk", 1993; OEIS A001412 counts them). A tree
grows cube by cube, each on a face of the shape so far, so it may branch.
"""

from collections.abc import Iterator
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from iqtt.shapes.polycube import MAX_CUBES, canonical_class, set_ids

Kind: TypeAlias = Literal["chain", "tree"]

STEPS = np.array(
    [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], dtype=np.int8
)
"""The six face directions, (6, 3) int8; the opposite of `STEPS[i]` is `STEPS[i ^ 1]`."""

MAX_GROWN = 65536  # cubes compared with others at a time: bounds the memory


def check_request(cubes: int, kind: Kind) -> None:
    """Raise ValueError where the number of cubes is not 1 to MAX_CUBES, or the kind is unknown."""
    if kind not in ("chain", "tree"):
        raise ValueError(f"kind is 'chain' or 'tree', not {kind!r}")
    if not 1 <= cubes <= MAX_CUBES:
        raise ValueError(f"a shape has 1 to {MAX_CUBES} cubes, not {cubes}")


def random_shapes(
    rng: np.random.Generator, tries: int, cubes: int, kind: Kind = "chain"
) -> NDArray[np.int8]:
    """Return random shapes, repeats included, as they were grown: (at most tries, cubes, 3) int8.

    Chains are uniform over the self-avoiding walks of this length, their rows in walking order;
    tries that meet themselves are missing. Trees grow on a face that is drawn uniformly from those
    with a free cell in front; every try gives one. The first cube is at the origin.

    Raises ValueError as `check_request`.
    """
    check_request(cubes, kind)
    return _walks(rng, tries, cubes) if kind == "chain" else _grown(rng, tries, cubes)


def _walks(rng: np.random.Generator, tries: int, cubes: int) -> NDArray[np.int8]:
    """Return uniform walks that never turn straight back, except those that meet themselves.

    What is left is uniform because whole walks are refused and none is mended. Three in four walks
    of 11 cubes are left, and half of those of 16.
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
    """Return shapes that grew on uniformly drawn free faces, (count, cubes, 3)."""
    shapes = np.zeros((count, cubes, 3), dtype=np.int8)
    for size in range(1, cubes):
        waiting = np.arange(count)
        # This ends: a shape of at most MAX_CUBES cubes has many free faces, so every round places
        # the next cube of many of the shapes that still wait for it.
        while len(waiting):
            base = shapes[waiting, rng.integers(size, size=len(waiting))]
            cell = base + STEPS[rng.integers(6, size=len(waiting))]
            taken = (shapes[waiting, :size] == cell[:, None]).all(axis=2).any(axis=1)
            shapes[waiting[~taken], size] = cell[~taken]
            waiting = waiting[taken]
    return shapes


def all_classes(cubes: int, kind: Kind = "chain") -> NDArray[np.int8]:
    """Return every shape of so many cubes, one of each class (a shape and its mirror image).

    They come as `canonical_class` gives them, in the order of their ids, (S, cubes, 3) int8. OEIS
    A038119 counts the classes of trees. Work and memory grow about fivefold with each cube for
    chains, sevenfold for trees: see `splits.LISTED_CUBES` for what is quick.

    Raises ValueError as `check_request`.
    """
    check_request(cubes, kind)
    if kind == "chain":
        return distinct(canonical_class(all_walks(cubes)))
    shapes = np.zeros((1, 1, 3), dtype=np.int8)
    for _ in range(1, cubes):
        shapes = distinct(np.concatenate([distinct(canonical_class(p)) for p in _one_more(shapes)]))
    return shapes


def all_walks(cubes: int) -> NDArray[np.int8]:
    """Return every self-avoiding walk of so many cubes, one of each orbit of the 48 symmetries.

    The first step goes along +x, the first that leaves that line along +y, the first that leaves
    that plane along +z. So a straight walk stands for 6 walks, a flat one for 24 and any other for
    48; together these are the walks that OEIS A001412 counts. The result is (W, cubes, 3) int8,
    rows in walking order, the first cube at the origin.
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
    """Return the distinct ones of shapes in canonical form, in the order of their ids."""
    _, first = np.unique(set_ids(shapes), return_index=True)
    return shapes[first]


def _one_more(shapes: NDArray[np.int8]) -> Iterator[NDArray[np.int8]]:
    """Yield, part by part, all shapes with one more cube on a free face, some repeatedly."""
    size = shapes.shape[1]
    for start in range(0, len(shapes), MAX_GROWN // (6 * size)):
        part = shapes[start : start + MAX_GROWN // (6 * size)]
        cells = (part[:, :, None] + STEPS).reshape(len(part), -1, 3)
        rows, face = np.nonzero(~(cells[:, :, None] == part[:, None]).all(axis=3).any(axis=2))
        yield np.concatenate([part[rows], cells[rows, face][:, None]], axis=1)


def _cells(shapes: NDArray[np.int8]) -> NDArray[np.int32]:
    """Return a number for each cube, (S, n), equal for cubes of a shape in the same cell."""
    x, y, z = np.moveaxis(shapes.astype(np.int32), 2, 0)
    return np.asarray((x << 16) + (y << 8) + z)
