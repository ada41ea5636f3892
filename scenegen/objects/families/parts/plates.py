"""Sheets over a grid of points: the peaks of caps."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.objects.families.parts.surfaces import Part

Array = NDArray[Any]


def plate(grid: Array, up: Array, thickness: float) -> Part:
    """A sheet over (rows, columns, 3) points, thick upwards, with upright sides.

    Rows go along +z and columns along +x, and each column's points lie on a line. `up` are the
    upper side's normals, (rows, columns, 3); the sides' are those of straight pieces.
    """
    lift = np.array([0.0, thickness, 0.0])
    top = grid + lift
    faces = [_sheet(top, up), _sheet(grid[:, ::-1], -up[:, ::-1])]
    # The border, so that the outside is on the right as seen from above.
    border = np.concatenate([grid[0, :-1], grid[:-1, -1], grid[-1, :0:-1], grid[:0:-1, 0]])
    after = np.roll(border, -1, axis=0)
    along = after - border
    out = np.stack([along[:, 2], 0 * along[:, 1], -along[:, 0]], axis=1)
    out /= np.sqrt((out * out).sum(axis=1, keepdims=True))
    quads = np.stack([border, border + lift, after + lift, after], axis=1)
    side = quads[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3, 3)
    faces.append((side, np.repeat(out[:, None], 6, axis=1).reshape(-1, 3, 3)))
    ends = np.concatenate([grid[0], grid[-1], top[0], top[-1]])
    triangles, normals = (np.concatenate(several) for several in zip(*faces, strict=True))
    return Part(triangles, normals, ends, np.zeros(len(ends)))


def _sheet(points: Array, normals: Array) -> tuple[Array, Array]:
    """Two triangles for each cell of (rows, columns, 3) points."""
    normals = normals / np.sqrt((normals * normals).sum(axis=-1, keepdims=True))
    i = np.arange(len(points) - 1)[:, None, None]
    j = np.arange(points.shape[1] - 1)[:, None]
    rows, columns = i + np.array([0, 1, 1, 0, 1, 0]), j + np.array([0, 0, 1, 0, 1, 1])
    return points[rows, columns].reshape(-1, 3, 3), normals[rows, columns].reshape(-1, 3, 3)
