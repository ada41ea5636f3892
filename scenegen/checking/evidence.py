"""How far the views of a folder disagree: a number for each kind of evidence, 0 for none.

Each is a robust middle, so that occlusion, noise and surfaces that shine do not matter.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.checking.views import View

Array = NDArray[Any]
Pair = tuple[int, int]
POINTS = 1200  # pixels of a view that are looked at
AGREEING = 0.25  # share of the pixels of a pair that must agree: others may be hidden
SMOOTH = 1.15  # factor between the depths of neighbours across which no surface goes on
BENT = 0.02  # change of slope, relative to the depth, across which no plane goes on
LEAST_CONTRAST = 2.0  # of 255: standard deviation of brightness that can correlate
FEWEST = 20  # normals of a view that tell something


def depth_error(views: Sequence[View], pairs: Sequence[Pair]) -> float:
    """Return how far depths of pairs of views differ, relative to the depth."""
    found = [np.sort(_moved(views[i], views[j])[0]) for i, j in pairs]
    return float(np.median([off[int(AGREEING * len(off))] for off in found]))


def _moved(one: View, other: View) -> tuple[Array, Array, Array]:
    """Return how pixels of one view differ in depth in another one, (N,), and where they are.

    The difference is infinite where the other view does not see the place. Places are x and y in
    the other view, (2, N), and row and column in this one, (2, N).
    """
    assert one.depth is not None
    assert other.depth is not None
    row, column = _sample(one.depth)
    rays = one.rays(column + 0.5, row + 0.5) * one.depth[row, column, None]
    pose = one.world_from_camera
    assert pose is not None
    x, y, z = other.project(rays @ pose[:3, :3].T + pose[:3, 3])
    with np.errstate(all="ignore"):
        near, smooth = _between(other.depth, x, y)
        off = np.abs(np.log(z * near))
    return (
        np.where(smooth & np.isfinite(off), off, np.inf),
        np.stack([x, y]),
        np.stack([row, column]),
    )


def _sample(depth: Array) -> tuple[Array, Array]:
    """Return rows and columns of pixels of known depth, spread over an image."""
    known = np.flatnonzero(np.isfinite(depth))
    chosen = known[np.linspace(0, len(known) - 1, min(POINTS, len(known))).astype(int)]
    return np.unravel_index(chosen, depth.shape)


def _between(field: Array, x: Array, y: Array) -> tuple[Array, Array]:
    """Return values of a map between its pixels, and where they may be used.

    Of depths, (H, W), it is 1 / depth, which is exact on planes, where no edge is near; of images,
    (H, W, 3), the colours inside.
    """
    height, width = field.shape[:2]
    inside = (x > 0.5) & (x < width - 0.5) & (y > 0.5) & (y < height - 0.5)
    x, y = np.where(inside, x - 0.5, 0.0), np.where(inside, y - 0.5, 0.0)
    left, top = np.minimum(x.astype(int), width - 2), np.minimum(y.astype(int), height - 2)
    corners = [field[top + j, left + i].astype(float) for j in (0, 1) for i in (0, 1)]
    u, v = x - left, y - top
    shares = [(1 - u) * (1 - v), u * (1 - v), (1 - u) * v, u * v]
    if field.ndim == 3:
        return sum(s[:, None] * c for s, c in zip(shares, corners, strict=True)), inside
    low, high = np.minimum.reduce(corners), np.maximum.reduce(corners)
    values = sum(s / c for s, c in zip(shares, corners, strict=True))
    return values, inside & (low > 0) & (high < SMOOTH * low)


def color_error(views: Sequence[View], pairs: Sequence[Pair]) -> float:
    """Return how little the brightness of places that two views see correlates, 0 to 2.

    It is 1 minus the correlation, which exposure does not change; NaN for no such places.
    """
    found = []
    for i, j in pairs:
        one, other = views[i].image, views[j].image
        off, (x, y), (row, column) = _moved(views[i], views[j])
        same = off < 0.01
        if one is None or other is None or same.sum() < 50:
            continue
        both = (
            one[row[same], column[same]].mean(axis=-1),
            _between(other, x[same], y[same])[0].mean(axis=-1),
        )
        if min(np.std(both[0]), np.std(both[1])) > LEAST_CONTRAST:
            found.append(1 - np.corrcoef(*both)[0, 1])
    return float(np.median(found)) if found else np.nan


def normal_error(views: Sequence[View]) -> float:
    """Return the median angle between normals and those of the depth, in degrees; NaN for none."""
    found = []
    for given, expected in map(normals_of_depth, views):
        if len(expected) >= FEWEST:
            cosine = np.clip((given * expected).sum(axis=1), -1, 1)
            found.append(np.median(np.degrees(np.arccos(cosine))))
    return float(np.median(found)) if found else np.nan


def normals_of_depth(view: View) -> tuple[Array, Array]:
    """Return some of a view's normals and those of its depth, (N, 3), where that is smooth."""
    depth = view.depth
    if depth is None or view.normal is None:
        return np.zeros((0, 3)), np.zeros((0, 3))
    step = max(1, len(depth) // 96)  # wider than the steps in which depths are stored
    height, width = depth.shape
    every = max(1, int(np.sqrt(height * width / POINTS)))
    row, column = np.mgrid[step : height - step : every, step : width - step : every].reshape(2, -1)
    right, left, below, above, middle = (
        (row + j * step, column + i * step)
        for i, j in ((1, 0), (-1, 0), (0, 1), (0, -1), (0, 0))
    )  # fmt: skip
    points = [
        view.rays(x + 0.5, y + 0.5) * depth[y, x, None] for y, x in (right, left, below, above)
    ]
    with np.errstate(all="ignore"):
        across = np.cross(points[2] - points[3], points[0] - points[1])
        across /= np.linalg.norm(across, axis=-1, keepdims=True)
        far = [depth[place] for place in (right, left, below, above, middle)]
        bent = np.maximum(np.abs(far[4] / far[0] + far[4] / far[1] - 2),
                          np.abs(far[4] / far[2] + far[4] / far[3] - 2))  # fmt: skip
    given = view.normal[middle]
    flat = (bent < BENT) & np.isfinite(across).all(axis=-1) & np.isfinite(given).all(axis=-1)
    facing = (across * view.rays(column + 0.5, row + 0.5)).sum(axis=-1, keepdims=True) < 0
    return given[flat], np.where(facing, across, -across)[flat]


def track_error(views: Sequence[View]) -> float:
    """Return the median distance of observations from their points, in pixels."""
    found = []
    for view in views:
        assert view.points is not None
        assert view.pixels is not None
        x, y, _ = view.project(view.points)
        off = np.hypot(x - view.pixels[:, 0], y - view.pixels[:, 1])
        found.append(np.median(np.where(np.isfinite(off), off, np.inf)))
    return float(np.median(found))
