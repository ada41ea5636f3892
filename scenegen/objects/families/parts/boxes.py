"""Boxes with flat sides, which may be tapered or lean."""

import math
from collections.abc import Sequence

import numpy as np

from scenegen.objects.families.parts.profiles import Point
from scenegen.objects.families.parts.surfaces import Part

Corner = tuple[float, float, float]


def box(
    low: Corner, high: Corner, shift: Point = (0.0, 0.0), taper: Point = (1.0, 1.0)
) -> list[Corner]:
    """Return the eight corners of a box between two points.

    Args:
        low, high: opposite corners, before shift and taper.
        shift: how far the top moves, (x, z).
        taper: factors of the top's half sizes, (x, z).
    """
    x, z = (low[0] + high[0]) / 2, (low[2] + high[2]) / 2
    half_x, half_z = (high[0] - low[0]) / 2, (high[2] - low[2]) / 2
    corners = []
    for y, (move_x, move_z), (a, b) in (
        (low[1], (0.0, 0.0), (half_x, half_z)),
        (high[1], shift, (half_x * taper[0], half_z * taper[1])),
    ):
        for sx, sz in ((-1, -1), (-1, 1), (1, 1), (1, -1)):
            corners.append((x + move_x + sx * a, y, z + move_z + sz * b))
    return corners


def spoke(
    x: float, angle: float, reach: float, half_width: float, levels: Sequence[Point]
) -> list[Corner]:
    """Return the eight corners of a bar that starts at (x, z) = (x, 0).

    Args:
        angle: its direction, in radians from the x axis towards z.
        levels: the heights at its start and at its end, of the lower side and of the upper side.
    """
    c, s = math.cos(angle), math.sin(angle)
    ends = ((0.0, -half_width), (0.0, half_width), (reach, half_width), (reach, -half_width))
    return [
        (x + along * c - across * s, far if along else near, along * s + across * c)
        for near, far in levels
        for along, across in ends
    ]


_SIDES = np.array(
    [[3, 2, 1, 0], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]]
)


def boxes(corners: Sequence[Sequence[Corner]]) -> Part:
    """Return boxes, each given by its `box` corners, as one flat-shaded part."""
    points = np.array(corners)
    quads = points[:, _SIDES].reshape(-1, 4, 3)
    faces = 4 * np.arange(len(quads))[:, None, None] + np.array([[0, 1, 2], [0, 2, 3]])
    face = np.cross(quads[:, 2] - quads[:, 0], quads[:, 3] - quads[:, 1])
    face /= np.sqrt((face * face).sum(axis=1, keepdims=True))
    hull = points.reshape(-1, 3)
    mesh = quads.reshape(-1, 3), faces.reshape(-1, 3), np.repeat(face, 4, axis=0)
    return Part(*mesh, hull, np.zeros(len(hull)), len(corners))
