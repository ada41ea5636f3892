"""Where a ray meets an exact surface (`objects.exact_surfaces`), in Dr.Jit.

All rays of a SIMD packet meet the same object, so a branch for each kind of surface costs those of
the other kinds nothing. Rays are given by the point c that is nearest to the origin of the unit
shape's frame and a unit direction u. All roots are solved from there, where float32 is finest.
"""

from collections.abc import Sequence
from dataclasses import astuple, dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from scenegen.objects.exact_surfaces import Capsule, Polyhedron, Surface, Torus, Turned
from scenegen.rendering.tables import gather_row, upload_table

WIDTH = 5  # floats of a row: a polyhedron has one for each slab, the others have one
MESH, POLYHEDRON, TURNED, CAPSULE, TORUS = range(5)  # the kinds of surfaces
KINDS: dict[type, int] = {
    Polyhedron: POLYHEDRON,
    Turned: TURNED,
    Capsule: CAPSULE,
    Torus: TORUS,
    type(None): MESH,
}
CURVED, CAP = 0xFFFFFFFF, 0xFFFFFFFE  # stand for the row of the slab that is hit
TINY = 1e-12  # stands for 0 where one divides by it
MARGIN = 1.05  # the torus's roots are searched a bit before and behind it
STEP = 1e-6  # the last step of that search
MOST_STEPS = 50


@dataclass(frozen=True, eq=False)
class Surfaces:
    """The exact surfaces of a batch's shapes.

    Attributes:
        kinds: the kinds that occur; the kernel treats no other.
        record: kind, first row and number of rows of each shape, (S, 3) integers.
        rows: table of what the surfaces are, WIDTH floats a row, on the device.
    """

    kinds: frozenset[int]
    record: NDArray[np.int64]
    rows: Any


def upload_surfaces(surfaces: Sequence[Surface | None]) -> Surfaces:
    """Copy surfaces to the device of the current Mitsuba variant; None stands for a mesh."""
    kinds = [KINDS[type(surface)] for surface in surfaces]
    tables = [np.zeros((1, WIDTH))]  # no array on the device may be empty
    for surface in surfaces:
        if isinstance(surface, Polyhedron):
            tables.append(surface.slabs)
        elif surface is not None:
            tables.append(np.resize([*astuple(surface), 0, 0, 0], (1, WIDTH)))
        else:
            tables.append(np.zeros((0, WIDTH)))
    sizes = np.array([len(table) for table in tables])
    record = np.stack([kinds, np.cumsum(sizes)[:-1], sizes[1:]], axis=1)
    return Surfaces(frozenset(kinds), record, upload_table(np.concatenate(tables)))


@dr.syntax
def first_on_surface(
    surfaces: Surfaces, record: Any, start: Any, u: Any, reach: Any
) -> tuple[Any, Any]:
    """Return the distance from `start` to the first hit, inf for none, and its face.

    Args:
        record: kind, first row and number of rows, as floats.
        start, u: point and unit direction, in the unit shape's frame.
        reach: how far the ray may go; hits beyond may be found or not.
    """
    behind = dr.dot(start, u)
    c = start - behind * u
    near = mi.Float(dr.inf)
    far = mi.Float(dr.inf)
    near_face = mi.UInt32(CURVED)
    far_face = mi.UInt32(CURVED)
    kind = record[0]
    first = mi.UInt32(record[1])
    if dr.hint(POLYHEDRON in surfaces.kinds, mode="scalar"):  # noqa: SIM102
        if dr.hint(kind == POLYHEDRON, exclude=[surfaces]):
            last = first + mi.UInt32(record[2])
            near, far, near_face, far_face = _polyhedron(surfaces, first, last, c, u)
    if dr.hint(TURNED in surfaces.kinds, mode="scalar"):  # noqa: SIM102
        if dr.hint(kind == TURNED, exclude=[surfaces]):
            row = gather_row(surfaces.rows, first, WIDTH)
            near, far, near_face, far_face = _turned(row, c, u)
    if dr.hint(CAPSULE in surfaces.kinds, mode="scalar"):  # noqa: SIM102
        if dr.hint(kind == CAPSULE, exclude=[surfaces]):
            half, radius = gather_row(surfaces.rows, first, WIDTH)[:2]
            near, far = _capsule(half, radius, c, u)
    if dr.hint(TORUS in surfaces.kinds, mode="scalar"):  # noqa: SIM102
        if dr.hint(kind == TORUS, exclude=[surfaces]):
            ring, tube = gather_row(surfaces.rows, first, WIDTH)[:2]
            near = _torus(ring, tube, c, u, behind, behind + reach)
            far = near
    ahead = near > behind
    x = dr.select(ahead, near, far)
    x = dr.select((near <= far) & (x > behind), x - behind, dr.inf)
    return x, dr.select(ahead, near_face, far_face)


@dr.syntax
def normal_on_surface(surfaces: Surfaces, record: Any, p: Any, face: Any) -> Any:
    """Return a normal of a surface at its point p, not normalised, of either sign."""
    kind = record[0]
    n = mi.Vector3f(0, 1, 0)
    if dr.hint(kind == POLYHEDRON, exclude=[surfaces]):
        n = mi.Vector3f(*gather_row(surfaces.rows, face, WIDTH)[:3])
    if dr.hint((kind > POLYHEDRON) & (face == CURVED), exclude=[surfaces]):
        row = gather_row(surfaces.rows, mi.UInt32(record[1]), WIDTH)
        y = dr.select(kind == TURNED, -0.5 * row[1] - row[2] * p.y, p.y)
        y = dr.select(kind == CAPSULE, p.y - dr.clip(p.y, -row[0], row[0]), y)
        ring = dr.select(kind == TORUS, row[0], 0)
        across = 1 - ring / dr.maximum(dr.norm(mi.Vector2f(p.x, p.z)), TINY)
        n = mi.Vector3f(p.x * across, y, p.z * across)
    return n


@dr.syntax
def _polyhedron(surfaces: Surfaces, first: Any, last: Any, c: Any, u: Any) -> Any:
    """Return where a ray enters and leaves the polyhedron, and the rows of those two slabs."""
    near = mi.Float(-dr.inf)
    far = mi.Float(dr.inf)
    near_face = mi.UInt32(first)
    far_face = mi.UInt32(first)
    j = mi.UInt32(first)
    while dr.hint(j < last, exclude=[surfaces]):
        x, y, z, low, high = gather_row(surfaces.rows, j, WIDTH)
        n = mi.Vector3f(x, y, z)
        enter, leave = _slab(dr.dot(n, c), dr.dot(n, u), low, high)
        near_face = dr.select(enter > near, j, near_face)
        far_face = dr.select(leave < far, j, far_face)
        near = dr.maximum(near, enter)
        far = dr.minimum(far, leave)
        j += 1
    return near, far, near_face, far_face


def _slab(at: Any, slope: Any, low: Any, high: Any) -> tuple[Any, Any]:
    """Return the least and the largest x with low <= at + slope x <= high."""
    inverse = 1 / _away_from_zero(slope)
    first, second = (low - at) * inverse, (high - at) * inverse
    return dr.minimum(first, second), dr.maximum(first, second)


def _turned(row: Sequence[Any], c: Any, u: Any) -> tuple[Any, Any, Any, Any]:
    """Return where a ray enters and leaves a `Turned`, and whether on CAP or CURVED."""
    constant, linear, square, low, high = row
    # Inside, q2 x^2 + 2 q1 x + q0 <= 0.
    q2 = _away_from_zero(u.x * u.x + u.z * u.z - square * u.y * u.y)
    q1 = c.x * u.x + c.z * u.z - (0.5 * linear + square * c.y) * u.y
    q0 = c.x * c.x + c.z * c.z - (constant + (linear + square * c.y) * c.y)
    inside = q1 * q1 - q2 * q0
    stable = -(q1 + dr.copysign(dr.sqrt(dr.maximum(inside, 0)), q1))
    first, second = stable / q2, q0 / _away_from_zero(stable)
    enter, leave = dr.minimum(first, second), dr.maximum(first, second)
    # A ray steeper than a cone is inside before and behind the roots, in one of its two halves
    # each; the cone is the lower one.
    steep, down = q2 < 0, u.y < 0
    enter, leave = (
        dr.select(steep, dr.select(down, leave, -dr.inf), enter),
        dr.select(steep, dr.select(down, dr.inf, enter), leave),
    )
    bottom, top = _slab(c.y, u.y, low, high)
    near = dr.select(steep | (inside > 0), dr.maximum(enter, bottom), dr.inf)
    faces = (dr.select(on_cap, mi.UInt32(CAP), CURVED) for on_cap in (bottom > enter, top < leave))
    return near, dr.minimum(leave, top), *faces


def _capsule(half: Any, radius: Any, c: Any, u: Any) -> tuple[Any, Any]:
    """Return where a ray enters and leaves a `Capsule`: on its cylinder or the ball at an end."""
    squared = dr.maximum(u.x * u.x + u.z * u.z, TINY)
    along = c.x * u.x + c.z * u.z
    across = c.x * u.z - c.z * u.x
    inside = squared * radius * radius - across * across
    root = dr.sqrt(dr.maximum(inside, 0))
    meets = inside > 0
    ends = []
    for sign in (-1, 1):
        x = (sign * root - along) / squared
        center = dr.clip(c.y + x * u.y, -half, half)
        from_center = mi.Vector3f(c.x, c.y - center, c.z)
        middle = -dr.dot(from_center, u)
        miss = from_center + middle * u
        inside = radius * radius - dr.dot(miss, miss)
        at_end = dr.abs(center) >= half
        meets &= ~at_end | (inside > 0)
        on_ball = middle + sign * dr.sqrt(dr.maximum(inside, 0))
        ends.append(dr.select(at_end, on_ball, x))
    return dr.select(meets, ends[0], dr.inf), ends[1]


@dr.syntax
def _torus(ring: Any, tube: Any, c: Any, u: Any, least: Any, most: Any) -> Any:
    """Return where a ray first meets a `Torus` between `least` and `most`, or inf.

    The surface is where (p . p + ring^2 - tube^2)^2 = 4 ring^2 (p_x^2 + p_z^2), a quartic in x.
    From one side of the surface, each step goes to where it would be if the quartic were bent
    towards 0 by as much as it is anywhere ahead: never past a root, and ever closer to the first.
    """
    enter, leave = _slab(c.y, u.y, -MARGIN * tube, MARGIN * tube)
    most = dr.minimum(most, leave)
    x = dr.maximum(least, enter)
    m = dr.dot(c, c) + (ring - tube) * (ring + tube)
    e = dr.dot(c, u)  # 0 but for rounding
    f = 4 * ring * ring
    k3 = 4 * e
    k2 = 2 * m + 4 * e * e - f * (u.x * u.x + u.z * u.z)
    k1 = 4 * e * m - 2 * f * (c.x * u.x + c.z * u.z)
    k0 = m * m - f * (c.x * c.x + c.z * c.z)
    side = dr.select((((x + k3) * x + k2) * x + k1) * x + k0 < 0, mi.Float(-1), mi.Float(1))
    active = x <= most
    n = mi.UInt32(0)
    while active:
        value = side * ((((x + k3) * x + k2) * x + k1) * x + k0)
        slope = side * (((4 * x + 3 * k3) * x + 2 * k2) * x + k1)
        flattest = dr.clip(-0.25 * k3, x, most)  # where the second derivative has its least value
        bends = [side * ((12 * at + 6 * k3) * at + 2 * k2) for at in (x, flattest, most)]
        bend = dr.maximum(-dr.minimum(bends[0], dr.minimum(bends[1], bends[2])), 0)
        root = dr.sqrt(dr.maximum(slope * slope + 2 * bend * value, 0))
        falling = 2 * value / (root - slope)
        rising = dr.select(bend > 0, (slope + root) / bend, dr.inf)
        step = dr.select(slope < 0, falling, rising)
        x += step
        n += 1
        active = (step > STEP) & (x <= most) & (n < MOST_STEPS)
    return dr.select(x <= most, x, dr.inf)


def _away_from_zero(x: Any) -> Any:
    return dr.select(dr.abs(x) < TINY, TINY, x)
