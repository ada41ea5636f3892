"""The convex bodies of shapes, many of different shapes at once: how far they reach, how they rest.

Everything is the same on every machine, although matrix products may add in any order: a product
of numbers rounded to 2**-26 and 2**-25 is a multiple of 2**-51, of which doubles add up to four
units exactly.
"""

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.objects.coarse_hulls import MOST_CORNERS, POINT_STEP, coarse_hull, rounded
from scenegen.objects.solids import UnitShape

Array = NDArray[Any]
DIRECTION_STEP = 2.0**-25
BLOCK = 512  # points that are multiplied at once
MARGIN = 2.0**-24  # scene units; more than rounding can take away from what an object reaches


def along(points: Array, directions: Array) -> Array:
    """Return the products of points, (N, 3), and directions, (D, 3): (N, D).

    In blocks so small that BLAS keeps to one thread: its threads would wait for each other, and the
    renderer needs the other cores.
    """
    products = np.empty((len(points), len(directions)))
    for start in range(0, len(points), BLOCK):
        block = slice(start, start + BLOCK)
        np.matmul(points[block], directions.T, out=products[block])
    return products


def _products(points: Array, directions: Array) -> Array:
    """Return the products of each body's points, (N, C, 3), and directions: (N, C, D).

    Directions are those of all bodies, (D, 3), or of each, (N, D, 3).
    """
    if directions.ndim == 3:
        return np.asarray(points @ directions.swapaxes(1, 2))
    return along(points.reshape(-1, 3), directions).reshape(*points.shape[:2], -1)


class Bodies:
    """What placement needs of a number of shapes, in groups of shapes with about as many points."""

    def __init__(self, shapes: Sequence[UnitShape]) -> None:
        """Collect the hulls and the resting directions of shapes, which are then known by place."""
        # Hulls and sides come from libraries whose last bits differ between machines.
        hulls = [rounded(_corners(shape), POINT_STEP) for shape in shapes]
        coarse = [shape.coarse or (_coarse(shape) if len(hull) > MOST_CORNERS else (hull, 0.0))
                  for shape, hull in zip(shapes, hulls, strict=True)]  # fmt: skip
        self._hulls = _groups(hulls, 8)
        self._coarse = _groups([hull for hull, _ in coarse], 8)
        sides = [rounded(shape.resting_directions, POINT_STEP) for shape in shapes]
        self._sides = _groups(sides, 32)
        self._rounding = np.array([shape.rounding for shape in shapes])
        self._growth = np.array([growth for _, growth in coarse])

    def reach(self, kind: Array, rotation: Array, directions: Array, coarse: bool = False) -> Array:
        """Return how far turned bodies reach along directions: (N, D), in bounding radii.

        Args:
            kind: which shape each is, (N,).
            rotation: matrices, (N, 3, 3).
            directions: about unit, multiples of DIRECTION_STEP, (D, 3) or each body's (N, D, 3).
            coarse: whether bodies with very many corners may be larger than they are, by a few
                thousandths.
        """
        reaches = np.empty((len(kind), directions.shape[-2]))
        for rows, corners in _members(self._coarse if coarse else self._hulls, kind):
            turned = _turned(rotation[rows, None], corners[..., :3])
            radius = np.broadcast_to(corners[..., 3:], (*turned.shape[:2], 1))
            flat = rounded(rotation[rows], POINT_STEP)
            own = directions[rows] if directions.ndim == 3 else directions
            ahead, across = (_products(flat[:, None, :, k], own)[:, 0] for k in (0, 2))
            sine = np.sqrt(ahead * ahead + across * across)[:, None]
            farthest = np.empty((len(rows), directions.shape[-2]))
            count = turned.shape[1]
            step = max(1, BLOCK // count)  # bodies, so few that all stays in the cache
            for first in range(0, len(rows), step):
                block = slice(first, first + step)
                reach = _products(turned[block], own[block] if own.ndim == 3 else own)
                reach += radius[block] * sine[block]
                reach.max(axis=1, out=farthest[block])
            reaches[rows] = farthest
        more = self._rounding + self._growth if coarse else self._rounding
        return np.asarray(reaches + more[kind, None])

    def resting_side(self, kind: Array, down: Array) -> Array:
        """Return the resting direction next to `down`, (N, 3), object frame: (N, 3).

        NaN for shapes that rest on any side.
        """
        nearest_sides = np.full((len(kind), 3), np.nan)
        for rows, sides in _members(self._sides, kind):
            x, y, z = np.moveaxis(sides, -1, 0)
            dx, dy, dz = down[rows, :, None].swapaxes(0, 1)
            nearest = (x * dx + y * dy + z * dz).argmax(axis=1)
            every_side = np.broadcast_to(sides, (len(rows), *sides.shape[1:]))
            nearest_sides[rows] = every_side[np.arange(len(rows)), nearest]
        return nearest_sides


@lru_cache(maxsize=4)
def bodies_of(shapes: tuple[UnitShape, ...]) -> Bodies:
    """Return `Bodies`, kept for the shapes of the last few calls."""
    return Bodies(shapes)


@lru_cache(maxsize=256)
def _coarse(shape: UnitShape) -> tuple[Array, float]:
    return coarse_hull(_corners(shape))


def _corners(shape: UnitShape) -> Array:
    """Return the centres and radii of a hull's discs, (V, 4)."""
    return np.column_stack([shape.hull_points, shape.hull_discs])


_Group = tuple[Array, Array]  # each shape's place in `rows`, or -1; and the rows, (M, V, ...)


def _groups(parts: Sequence[Array], least: int) -> list[_Group]:
    """Stack arrays of about the same length, or of at most `least`; shorter ones repeat a row."""
    sizes = np.array([max(least, 1 << max(0, len(part) - 1).bit_length()) for part in parts])
    sizes[[not len(part) for part in parts]] = 0
    groups = []
    for size in sorted(set(sizes.tolist()) - {0}):
        members = np.flatnonzero(sizes == size).tolist()
        longest = max(len(parts[i]) for i in members)
        places = np.full(len(parts), -1)
        places[members] = np.arange(len(members))
        filled = [np.concatenate([parts[i], *[parts[i][:1]] * (longest - len(parts[i]))])
                  for i in members]  # fmt: skip
        groups.append((places, np.stack(filled)))
    return groups


def _members(groups: list[_Group], kind: Array) -> Any:
    """Yield, for each group, which of `kind` belong to it, and their rows, (n, V, ...)."""
    for places, rows in groups:
        place = places[kind]
        members = np.flatnonzero(place >= 0)
        if len(members):
            yield members, rows if len(rows) == 1 else rows[place[members]]


def _turned(rotation: Array, points: Array) -> Array:
    """Return rotation (..., 3, 3) applied to points (..., 3), rounded to POINT_STEP."""
    x, y, z = np.moveaxis(points, -1, 0)
    rows = [rotation[..., i, 0] * x + rotation[..., i, 1] * y + rotation[..., i, 2] * z
            for i in range(3)]  # fmt: skip
    return rounded(np.stack(rows, axis=-1), POINT_STEP)
