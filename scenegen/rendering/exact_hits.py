"""Where a ray meets an exact surface (`objects.exact_surfaces`), in Dr.Jit."""

from collections.abc import Sequence
from dataclasses import astuple, dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from scenegen.objects.exact_surfaces import Polyhedron, Surface, Torus, Turned, Capsule

MESH, POLYHEDRON, TURNED, CAPSULE, TORUS = range(5)
KINDS = {Polyhedron: POLYHEDRON, Turned: TURNED, Capsule: CAPSULE, Torus: TORUS}
WIDTH = 5
CURVED = 0xFFFFFFFF
CAP = 0xFFFFFFFE
TINY = 1e-12


@dataclass(frozen=True, eq=False)
class Surfaces:
    kinds: frozenset
    kind: Any
    first: Any
    count: Any
    rows: Any


def surface_tables(surfaces: Sequence[Surface | None]):
    rows, kind, first, count = [np.zeros((1, WIDTH))], [], [], []
    start = 1
    for s in surfaces:
        if s is None:
            mine = np.zeros((0, WIDTH))
        elif isinstance(s, Polyhedron):
            mine = s.slabs
        else:
            mine = np.zeros((1, WIDTH)); v = astuple(s); mine[0, :len(v)] = v
        rows.append(mine); kind.append(KINDS.get(type(s), MESH)); first.append(start if len(mine) else 0); count.append(len(mine))
        start += len(mine)
    return np.array(kind, np.uint32), np.array(first, np.uint32), np.array(count, np.uint32), np.concatenate(rows)


def row_of(surfaces, row, width=WIDTH):
    return [dr.gather(mi.Float, surfaces.rows, row * WIDTH + i) for i in range(width)]


def away_from_zero(x):
    return dr.select(dr.abs(x) < TINY, TINY, x)


@dr.syntax
def interval(surfaces: Any, kind: Any, first: Any, count: Any, c: Any, u: Any) -> Any:
    """Return near, far, faces of them"""
    near = mi.Float(dr.inf)
    far = mi.Float(-dr.inf)
    near_face = mi.UInt32(CURVED)
    far_face = mi.UInt32(CURVED)
    if dr.hint(POLYHEDRON in surfaces.kinds, mode="scalar"):
        if dr.hint(kind == POLYHEDRON, exclude=[surfaces]):
            near, far, near_face, far_face = polyhedron(surfaces, first, count, c, u)
    if dr.hint(TURNED in surfaces.kinds, mode="scalar"):
        if dr.hint(kind == TURNED, exclude=[surfaces]):
            near, far, near_face, far_face = turned(row_of(surfaces, first), c, u)
    if dr.hint(CAPSULE in surfaces.kinds, mode="scalar"):
        if dr.hint(kind == CAPSULE, exclude=[surfaces]):
            half, radius = row_of(surfaces, first, 2)
            near, far = capsule(half, radius, c, u)
            near_face = mi.UInt32(CURVED)
            far_face = mi.UInt32(CURVED)
    return near, far, near_face, far_face


@dr.syntax
def polyhedron(surfaces, first, count, c, u):
    near = mi.Float(-dr.inf)
    far = mi.Float(dr.inf)
    near_face = mi.UInt32(first)
    far_face = mi.UInt32(first)
    j = mi.UInt32(first)
    end = first + count
    while dr.hint(j < end, exclude=[surfaces]):
        x, y, z, low, high = row_of(surfaces, j)
        n = mi.Vector3f(x, y, z)
        inverse = 1 / away_from_zero(dr.dot(n, u))
        at = dr.dot(n, c)
        a, b = (low - at) * inverse, (high - at) * inverse
        enter, leave = dr.minimum(a, b), dr.maximum(a, b)
        near_face = dr.select(enter > near, j, near_face)
        far_face = dr.select(leave < far, j, far_face)
        near = dr.maximum(near, enter)
        far = dr.minimum(far, leave)
        j += 1
    return near, far, near_face, far_face


def turned(row, c, u):
    a0, b0, c0, low, high = row
    A = u.x * u.x + u.z * u.z - c0 * u.y * u.y
    A = away_from_zero(A)
    B = c.x * u.x + c.z * u.z - (0.5 * b0 + c0 * c.y) * u.y
    C = c.x * c.x + c.z * c.z - (a0 + (b0 + c0 * c.y) * c.y)
    disc = B * B - A * C
    inside_out = A < 0
    meets = (disc > 0) | inside_out
    q = -(B + dr.copysign(dr.sqrt(dr.maximum(disc, 0)), B))
    x1, x2 = q / A, C / away_from_zero(q)
    lo, hi = dr.minimum(x1, x2), dr.maximum(x1, x2)
    # beyond: the cone's two nappes
    down = u.y < 0
    lo, hi = (dr.select(inside_out, dr.select(down, hi, -dr.inf), lo),
              dr.select(inside_out, dr.select(down, dr.inf, lo), hi))
    inverse = 1 / away_from_zero(u.y)
    p, r = (low - c.y) * inverse, (high - c.y) * inverse
    enter, leave = dr.minimum(p, r), dr.maximum(p, r)
    near, far = dr.maximum(lo, enter), dr.minimum(hi, leave)
    near = dr.select(meets, near, dr.inf)
    return near, far, dr.select(enter > lo, mi.UInt32(CAP), mi.UInt32(CURVED)), dr.select(leave < hi, mi.UInt32(CAP), mi.UInt32(CURVED))


def capsule(half, radius, c, u):
    A = dr.maximum(u.x * u.x + u.z * u.z, TINY)
    B = c.x * u.x + c.z * u.z
    cross = c.x * u.z - c.z * u.x
    disc = A * radius * radius - cross * cross
    root = dr.sqrt(dr.maximum(disc, 0))
    ends = []
    meets = disc > 0
    for sign in (-1, 1):
        x = (-B + sign * root) / A
        end = dr.clip(c.y + x * u.y, -half, half)
        w = mi.Vector3f(c.x, c.y - end, c.z)
        b = dr.dot(w, u)
        miss = w - b * u
        d2 = radius * radius - dr.dot(miss, miss)
        beyond = dr.abs(end) >= half
        y = -b + sign * dr.sqrt(dr.maximum(d2, 0))
        meets &= ~beyond | (d2 > 0)
        ends.append(dr.select(beyond, y, x))
    near, far = ends
    return dr.select(meets, near, dr.inf), far


@dr.syntax
def torus(ring: Any, tube: Any, c: Any, u: Any, least: Any, most: Any) -> Any:
    """Return the least root x, least <= x <= most, or inf."""
    # F = (|p|^2 + k)^2 - 4 ring^2 (x^2 + z^2),  |p|^2 = x^2 + m since c is the closest approach
    m = dr.dot(c, c) + (ring - tube) * (ring + tube)
    g2, g1, g0 = u.x * u.x + u.z * u.z, c.x * u.x + c.z * u.z, c.x * c.x + c.z * c.z
    f = 4 * ring * ring
    # (x^2 + 2 e x + m)^2 - f (g2 x^2 + 2 g1 x + g0), e ~ 0
    e = dr.dot(c, u)
    k3 = 4 * e
    k2 = 2 * m + 4 * e * e - f * g2
    k1 = 4 * e * m - 2 * f * g1
    k0 = m * m - f * g0
    x = mi.Float(least)
    sign = dr.select((((x + k3) * x + k2) * x + k1) * x + k0 < 0, mi.Float(-1), mi.Float(1))
    vertex = -0.25 * k3
    active = mi.Bool(True)
    n = mi.UInt32(0)
    while active & (n < 40):
        value = sign * ((((x + k3) * x + k2) * x + k1) * x + k0)
        slope = sign * (((4 * x + 3 * k3) * x + 2 * k2) * x + k1)
        def curvature(at):
            return sign * ((12 * at + 6 * k3) * at + 2 * k2)
        bend = dr.minimum(dr.minimum(curvature(x), curvature(most)), curvature(dr.clip(vertex, x, most)))
        bend = dr.maximum(-bend, 0)
        # value + slope h - bend h^2 / 2 = 0
        root = dr.sqrt(dr.maximum(slope * slope + 2 * bend * value, 0))
        step = dr.select(slope < 0, 2 * value / (root - slope), dr.select(bend > 0, (slope + root) / bend, dr.inf))
        x = x + step
        active = (step > 1e-6) & (x <= most)
        n += 1
    hit = x <= most
    return dr.select(hit, x, dr.inf)
