"""Plane curves: profiles to be turned or lofted, and centre lines of tubes.

A curve is (points, tangents), both (n, 2); tangents point along the curve and are not zero. Joined
curves keep both rows where they meet, so that a corner is a sharp crease. The columns of a profile
are (radius, height), and its outside is on the right of its direction.
"""

import math
from collections.abc import Sequence

import numpy as np

from scenegen.objects.solids import Array

Curve = tuple[Array, Array]
Point = tuple[float, float]


def line(*corners: Point, strips: int = 1) -> Curve:
    """Return straight pieces from corner to corner, each cut into `strips` equal parts."""
    ends = np.array(corners, float)
    share = np.tile(np.linspace(0.0, 1.0, strips + 1), len(ends) - 1)[:, None]
    along = np.repeat(np.diff(ends, axis=0), strips + 1, axis=0)
    points = np.repeat(ends[:-1], strips + 1, axis=0) + share * along
    points[strips :: strips + 1] = ends[1:]
    return points, along


def arc(center: Point, radius: float | Point, low: float, high: float, segments: int = 8) -> Curve:
    """Return an arc of a circle, or of an ellipse if two radii are given.

    It runs from the angle low to the angle high, in degrees from the first axis; counter-clockwise
    if low < high.
    """
    a, b = radius if isinstance(radius, tuple) else (radius, radius)
    angle = np.radians(np.linspace(low, high, segments + 1))
    cosine, sine = np.cos(angle), np.sin(angle)
    cosine[np.abs(cosine) < 1e-15] = 0.0
    sine[np.abs(sine) < 1e-15] = 0.0
    way = 1.0 if high > low else -1.0
    points = np.stack([center[0] + a * cosine, center[1] + b * sine], axis=1)
    return points, way * np.stack([-a * sine, b * cosine], axis=1)


def bezier(a: Point, b: Point, c: Point, d: Point, segments: int = 10) -> Curve:
    """Return a cubic Bezier curve with the control points a, b, c, d; b != a and c != d.

    Points are denser where the curve bends: they divide length plus twice the turning evenly, each
    measured as a share of its total.
    """
    corners = np.array([a, b, c, d], float)
    _, tangents = _cubic(corners, _FINE)
    speed = np.hypot(tangents[:, 0], tangents[:, 1])
    u, v = tangents[:-1], tangents[1:]
    turn = np.abs(np.arctan2(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0], (u * v).sum(axis=1)))
    length = speed[:-1] + speed[1:]
    share = np.zeros(len(_FINE))
    np.cumsum(length / length.sum() + 2 * turn / (turn.sum() + 0.1), out=share[1:])
    t = np.interp(np.linspace(0.0, share[-1], segments + 1), share, _FINE)
    t[[0, -1]] = 0.0, 1.0
    return _cubic(corners, t)


_FINE = np.linspace(0.0, 1.0, 49)


def _cubic(corners: Array, t: Array) -> Curve:
    """Return points of a Bezier curve at the parameters t, and a third of its derivative there."""
    s = 1.0 - t
    weights = np.stack([s * s * s, 3 * s * s * t, 3 * s * t * t, t * t * t], axis=1)
    slopes = np.stack([s * s, 2 * s * t, t * t], axis=1)
    # Summed in a fixed order, as the last bits of a matrix product depend on the machine.
    points = sum(weights[:, i : i + 1] * corners[i] for i in range(4))
    steps = np.diff(corners, axis=0)
    return np.asarray(points), np.asarray(sum(slopes[:, i : i + 1] * steps[i] for i in range(3)))


def fillet(corners: Sequence[Point], radius: float, segments: int = 6) -> Curve:
    """Return a line whose inner corners are rounded by arcs of this radius, which must fit."""
    points, tangents = [], []
    start = np.array(corners[0], float)
    for i in range(1, len(corners) - 1):
        corner, following = np.array(corners[i], float), np.array(corners[i + 1], float)
        into, out = corner - start, following - corner
        into, out = into / math.hypot(*into), out / math.hypot(*out)
        side = math.copysign(1.0, into[0] * out[1] - into[1] * out[0])
        turn = math.acos(max(-1.0, min(1.0, float(into[0] * out[0] + into[1] * out[1]))))
        begin = corner - radius * math.tan(turn / 2) * into
        center = begin + side * radius * np.array([-into[1], into[0]])
        spoke = math.degrees(math.atan2(begin[1] - center[1], begin[0] - center[0]))
        bend = arc(
            (center[0], center[1]), radius, spoke, spoke + side * math.degrees(turn), segments
        )
        points += [start[None], bend[0]]
        tangents += [into[None], bend[1]]
        start = corner + radius * math.tan(turn / 2) * out
        tangents += [out[None]]
        points += [start[None]]
    last = np.array(corners[-1], float)
    points.append(last[None])
    tangents.append((last - start)[None])
    joined, along = np.concatenate(points), np.concatenate(tangents)
    step = np.abs(np.diff(joined, axis=0)).max(axis=1)
    keep = np.concatenate([[True], step > 1e-9])  # a bend may end just where the next one begins
    return joined[keep], along[keep]


def reverse(curve: Curve) -> Curve:
    """Return the same curve in the opposite direction."""
    return curve[0][::-1], -curve[1][::-1]


def inset(curve: Curve, distance: float) -> Curve:
    """Return the parallel curve on the left (the inside of a profile), mitred at creases.

    No bend to the left may have a radius below the distance.
    """
    points, tangents = curve
    along = tangents / np.hypot(tangents[:, :1], tangents[:, 1:])
    left = np.stack([-along[:, 1], along[:, 0]], axis=1)
    crease = np.flatnonzero(np.abs(points[1:] - points[:-1]).max(axis=1) < 1e-12)
    before, after = left[crease], left[crease + 1]
    miter = (before + after) / (1.0 + (before * after).sum(axis=1, keepdims=True))
    left[crease], left[crease + 1] = miter, miter
    return points + distance * left, tangents


def tightest(curve: Curve) -> float:
    """Return, approximately, the smallest radius of curvature; creases do not count."""
    points, tangents = curve
    along = tangents / np.hypot(tangents[:, :1], tangents[:, 1:])
    u, v = along[:-1], along[1:]
    turn = np.abs(np.arctan2(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0], (u * v).sum(axis=1)))
    step = np.hypot(*(points[1:] - points[:-1]).T)
    return float((step / np.maximum(turn, 1e-9))[step > 1e-9].min())


def limited(curve: Curve, thickness: float) -> float:
    """Return a thickness, reduced where the curve bends too tightly for it."""
    return min(thickness, 0.7 * tightest(curve))


def wave(low: Point, high: Point, depth: float, count: int) -> Curve:
    """Return a straight piece with `count` cosine grooves, beginning and ending on a ridge."""
    t = np.linspace(0.0, 1.0, 5 * count + 1)
    points, tangents = line(low, high, strips=5 * count)
    phase = 2 * np.pi * count * t
    side = np.array([[low[1] - high[1], high[0] - low[0]]]) / math.dist(low, high)
    points = points + (depth * 0.5 * (1.0 - np.cos(phase)))[:, None] * side
    return points, tangents + (depth * np.pi * count * np.sin(phase))[:, None] * side


def join(*curves: Curve) -> Curve:
    """Join curves, each of which must begin where the one before it ends."""
    return np.concatenate([c[0] for c in curves]), np.concatenate([c[1] for c in curves])


def hull_rows(points: Array) -> list[int]:
    """Return the indices of points, (n, 2), that are corners of their convex hull, within 1e-13.

    This is Andrew's monotone chain algorithm.
    """
    points = np.round(points, 13)  # otherwise rounding errors make corners along straight pieces
    order = np.lexsort((points[:, 1], points[:, 0]))
    repeats = (np.diff(points[order], axis=0) == 0.0).all(axis=1)
    once = np.delete(order, np.flatnonzero(repeats) + 1).tolist()
    across, up = points.T.tolist()
    rows: set[int] = set()
    for sweep in (once, once[::-1]):  # the lower chain, then the upper
        chain: list[int] = []
        for i in sweep:
            x, y = across[i], up[i]
            while len(chain) > 1:
                a, b = chain[-2:]
                ax, ay = across[a], up[a]
                if (across[b] - ax) * (y - ay) - (up[b] - ay) * (x - ax) > 0.0:
                    break
                chain.pop()
            chain.append(i)
        rows.update(chain)
    return sorted(rows)
