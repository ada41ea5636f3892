"""Where rays meet exact surfaces (`objects.exact_surfaces`), in numpy and double precision.

It shares no formula with `in_kernel`: convex bodies are unions of simpler ones, and the torus is
solved between the extremes of its quartic.
"""

from functools import reduce
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.objects.exact_surfaces import FAR, Capsule, Polyhedron, Surface, Torus, Turned

Array = NDArray[Any]
STEPS = 30  # of Newton's search
MARGIN = 1.001  # by which the search for roots exceeds the torus
Interval = tuple[Array, Array]  # where rays enter and leave; empty where the first is larger


def cast_at_surface(surface: Surface, origins: Array, directions: Array) -> tuple[Array, Array]:
    """Return ray parameters (R,), inf for a miss, and outward unit normals (R, 3) of first hits."""
    middle = -_dot(origins, directions) / _dot(directions, directions)
    c = origins + middle[:, None] * directions  # the nearest points to the shape's centre
    roots = np.stack(surface_roots(surface, c, directions), axis=1)
    roots = np.where(roots > -middle[:, None], roots, np.inf)  # behind the origin
    first = roots.min(axis=1, initial=np.inf)
    points = c + np.where(np.isfinite(first), first, 0.0)[:, None] * directions
    return middle + first, _normals(surface, points)


def surface_roots(surface: Surface, c: Array, d: Array) -> list[Array]:
    """Return all x at which c + x d is on the surface, inf for those that are none.

    The points c are the nearest ones of their rays to the origin. The bits are those of every
    machine (`common.rotations`).
    """
    if isinstance(surface, Torus):
        return _torus(surface, c, d)
    if isinstance(surface, Capsule):
        half, radius = surface.half, surface.radius
        top = Turned(radius**2 - half**2, 2 * half, -1.0, -FAR, FAR)  # a ball about y = half
        bottom = Turned(top.a, -top.b, -1.0, -FAR, FAR)
        parts = [top, bottom, Turned(radius**2, 0.0, 0.0, -half, half)]
        spans = [_turned(part, c, d) for part in parts]
        spans = [(np.where(e < x, e, np.inf), np.where(e < x, x, -np.inf)) for e, x in spans]
        enter = np.minimum.reduce([e for e, _ in spans])
        leave = np.maximum.reduce([x for _, x in spans])
    elif isinstance(surface, Turned):
        enter, leave = _turned(surface, c, d)
    else:
        enter, leave = reduce(_both, [_slab(slab, c, d) for slab in surface.slabs])
    return [np.where(enter <= leave, x, np.inf) for x in (enter, leave)]


def _both(a: Interval, b: Interval) -> Interval:
    return np.maximum(a[0], b[0]), np.minimum(a[1], b[1])


def _slab(slab: Array, c: Array, d: Array) -> Interval:
    slope = _dot(d, slab[None, :3])
    slope = np.where(slope == 0, 1e-300, slope)
    ends = (slab[3:, None] - _dot(c, slab[None, :3])) / slope
    return ends.min(axis=0), ends.max(axis=0)


def _turned(surface: Turned, c: Array, d: Array) -> Interval:
    """Cut the ray with the quadric in the half of it that is between `low` and `high`."""
    slab = _slab(np.array([0.0, 1.0, 0.0, surface.low, surface.high]), c, d)
    square = np.array([1.0, -surface.c, 1.0])
    pairs = (d, d), (c, d), (c, c)
    q2, q1, q0 = (_dot(a * square, b) for a, b in pairs)
    q1, q0 = q1 - surface.b / 2 * d[:, 1], q0 - surface.a - surface.b * c[:, 1]
    q2 = np.where(abs(q2) < 1e-14, 1e-14, q2)
    root = np.sqrt(np.maximum(q1 * q1 - q2 * q0, 0.0))
    low, high = np.sort([(-q1 - root) / q2, (-q1 + root) / q2], axis=0)
    between = np.where(q1 * q1 > q2 * q0, low, np.inf), high
    down = d[:, 1] < 0
    outside = np.where(down, high, -np.inf), np.where(down, np.inf, low)
    enter, leave = (np.where(q2 > 0, b, o) for b, o in zip(between, outside, strict=True))
    return _both((enter, leave), slab)


def _torus(surface: Torus, c: Array, d: Array) -> list[Array]:
    """Solve the quartic between its extremes, these between those of its derivative."""
    ring, tube = surface.ring, surface.tube
    flat = np.array([1.0, 0.0, 1.0])
    pairs = (d, d), (2 * c, d), (c, c)
    p2, p1, p0 = (_dot(*pair) for pair in pairs)
    r2, r1, r0 = (_dot(a * flat, b) for a, b in pairs)
    m, f = p0 + ring**2 - tube**2, 4 * ring**2
    quartic = [p2**2, 2 * p2 * p1, p1**2 + 2 * p2 * m - f * r2, 2 * p1 * m - f * r1, m**2 - f * r0]
    cubic = [k * n for k, n in zip(quartic[:4], (4, 3, 2, 1), strict=True)]
    a, b = 3 * cubic[0], cubic[1]
    spread = np.sqrt(np.maximum(b * b - a * cubic[2], 0.0))
    far = (ring + tube) * MARGIN / np.sqrt(p2)
    bends = [-far, *(np.clip((sign * spread - b) / a, -far, far) for sign in (-1, 1)), far]
    extremes = [_root_between(cubic, *ends)[0] for ends in pairwise(bends)]
    parts = [_root_between(quartic, *ends) for ends in pairwise([-far, *extremes, far])]
    return [np.where(crosses, x, np.inf) for x, crosses in parts]


def _root_between(polynomial: list[Array], low: Array, high: Array) -> tuple[Array, Array]:
    """Return the root of a polynomial that is monotone from low to high, and whether there is one.

    Where there is none, it is the end at which the polynomial is nearer to 0. Newton's steps, and
    halves where these leave the range.
    """

    def value(factors: list[Array], x: Array) -> tuple[Array, Array]:
        y, slope = factors[0], np.zeros_like(x)
        for k in factors[1:]:
            y, slope = y * x + k, slope * x + y
        return y, slope

    at_low, at_high = value(polynomial, low)[0], value(polynomial, high)[0]
    crosses = (at_low < 0) != (at_high < 0)
    found = np.where(np.abs(at_low) < np.abs(at_high), low, high)
    factors = [k[crosses] for k in polynomial]
    low, high, negative = low[crosses], high[crosses], at_low[crosses] < 0
    x = (low + high) / 2
    for _ in range(STEPS):
        y, slope = value(factors, x)
        before = (y < 0) == negative
        low, high = np.where(before, x, low), np.where(before, high, x)
        with np.errstate(divide="ignore", invalid="ignore"):
            step = x - y / slope
        last, x = x, np.where((step >= low) & (step <= high), step, (low + high) / 2)
        if (np.abs(x - last) <= 1e-12).all():
            break
    found[crosses] = x
    return found, crosses


def _dot(a: Array, b: Array) -> Array:
    return np.asarray(a[:, 0] * b[:, 0] + a[:, 1] * b[:, 1] + a[:, 2] * b[:, 2])


def _normals(surface: Surface, p: Array) -> Array:
    """Return outward unit normals at points of the surface."""
    x, y, z = p.T
    if isinstance(surface, Polyhedron):
        normal, low, high = surface.slabs[:, :3], surface.slabs[:, 3], surface.slabs[:, 4]
        at = p @ normal.T
        beyond = np.concatenate([at - high, low - at], axis=1)
        return np.concatenate([normal, -normal])[beyond.argmax(axis=1)]
    if isinstance(surface, Torus):
        across = 1 - surface.ring / np.maximum(np.hypot(x, z), 1e-300)
        n = np.stack([x * across, y, z * across], axis=1)
    elif isinstance(surface, Capsule):
        n = np.stack([x, y - np.clip(y, -surface.half, surface.half), z], axis=1)
    else:
        n = np.stack([x, -surface.b / 2 - surface.c * y, z], axis=1)
        q = x * x + z * z - surface.a - surface.b * y - surface.c * y * y
        side = abs(q) / (2 * np.maximum(np.linalg.norm(n, axis=1), 1e-300))
        face = np.argmin([side, abs(y - surface.low), abs(y - surface.high)], axis=0)
        n[face > 0] = np.array([[0.0, -1.0, 0.0], [0.0, 1.0, 0.0]])[face[face > 0] - 1]
    return np.asarray(n / np.maximum(np.linalg.norm(n, axis=1, keepdims=True), 1e-300))
