"""Caps and hats: hollow crowns with peaks or brims. The peak points to +z."""

import math

import numpy as np
from numpy.random import Generator

from scenegen.objects.families.parts.draws import chance, pick, span
from scenegen.objects.families.parts.profiles import Curve, arc, bezier, join, line, reverse
from scenegen.objects.families.parts.surfaces import Part, joined, loft
from scenegen.objects.families.parts.walls import shell
from scenegen.objects.solids import Array

THICK = 0.04  # thickness of the cloth; a crown is about 2 long


def cap(rng: Generator) -> list[Part]:
    """Build a baseball cap (half of all), a cadet cap, a woolly hat, a bowler or a sun hat."""
    kinds = (_baseball, _baseball, _baseball, _baseball, _cadet, _woolly, _bowler, _sun_hat)
    return pick(rng, kinds)(rng)


def _dome(rng: Generator, height: float) -> Curve:
    """Return the profile of a crown's outside, from the band to the top."""
    steep, flat = span(rng, 0.35, 0.75), span(rng, 0.4, 0.95)
    band = span(rng, 0.02, 0.25) * height
    lean = span(rng, 0.97, 1.06)
    bend = (lean, band + steep * (height - band))
    dome = bezier((lean, band), bend, (flat, height), (0.0, height), 11)
    return join(line((1.0, 0.0), (lean, band)), dome)


def _oval(rng: Generator) -> tuple[float, float]:
    """Draw the half width (x) and half length (z) of a head's cross-section."""
    return 1.0, span(rng, 1.0, 1.22)


def _baseball(rng: Generator) -> list[Part]:
    height = span(rng, 0.75, 1.35)
    size = _oval(rng)
    wall = _dome(rng, height)
    lean = (0.0, span(rng, -0.05, 0.25))
    parts = [loft(shell(wall, THICK), size=size, lean=lean, closed=True)]
    if chance(rng, 0.8):  # the button
        button = arc((0.0, height), (0.09, 0.05), 0, 90, 4)
        top = (lean[0] * height, lean[1] * height)
        base = line((0.09, height - 0.03), (0.09, height))
        at = (top[0] - lean[0] * height, top[1] - lean[1] * height)
        parts.append(loft(join(base, button), at=at, lean=lean, segments=16))
    return [*parts, _peak(rng, size[1] - 1.0)]


def _cadet(rng: Generator) -> list[Part]:
    """Build a cadet cap: an upright band, a flat top that may be wider, and a peak."""
    height = span(rng, 0.55, 1.0)
    size = _oval(rng)
    wide, band = span(rng, 0.85, 1.4), span(rng, 0.3, 0.6) * height
    edge = 0.08
    wall = join(
        line((1.0, 0.0), (1.0, band)),
        bezier((1.0, band), (1.0, band + 0.1), (wide, height - 0.25), (wide, height - edge), 6),
        arc((wide - edge, height - edge), edge, 0, 90, 5),
        line((wide - edge, height), (0.0, height + 0.04)),
    )
    return [
        loft(shell(wall, THICK), size=size, lean=(0.0, span(rng, -0.1, 0.15)), closed=True),
        _peak(rng, size[1] - 1.0),
    ]


def _woolly(rng: Generator) -> list[Part]:
    """Build a close-fitting knitted hat, often with a turned-up band or a bobble."""
    height = span(rng, 1.0, 1.9)
    size = _oval(rng)
    wall = _dome(rng, height)
    parts = [loft(shell(wall, 1.5 * THICK), size=size, closed=True)]
    if chance(rng, 0.75):
        cuff, out = span(rng, 0.2, 0.5), 0.07
        edge = 0.06
        fold = join(
            arc((1.06 + out - edge, edge), edge, -90, 0, 4),
            line((1.06 + out, edge), (1.06 + out, cuff - edge)),
            arc((1.06 + out - edge, cuff - edge), edge, 0, 90, 4),
            line((1.06 + out - edge, cuff), (0.97, cuff), (0.97, 0.0), (1.06 + out - edge, 0.0)),
        )
        parts.append(loft(fold, size=size, closed=True))
    if chance(rng, 0.55):
        ball = span(rng, 0.15, 0.38)
        parts.append(loft(arc((0.0, height + 0.75 * ball), ball, -85, 90, 10), segments=24))
    return parts


def _bowler(rng: Generator) -> list[Part]:
    """Build a stiff hat with a brim all round: a bowler, a boater or a top hat."""
    height = span(rng, 0.6, 1.7)
    size = _oval(rng)
    brim, rise = span(rng, 0.25, 0.8), span(rng, 0.0, 0.22)
    top, edge = span(rng, 0.75, 1.12), span(rng, 0.05, 0.45) * min(1.0, height)
    begin, end = (top, height - 0.45 * edge), (top - 0.5 * edge, height)
    wall = join(
        bezier((1.0, 0.02), (1.0, 0.4 * height), (top, 0.5 * height), (top, height - edge), 8),
        bezier((top, height - edge), begin, end, (top - edge, height), 6),
        line((top - edge, height), (0.0, height - span(rng, 0.0, 0.08))),
    )
    outer, end = 1.0 + brim, (1.0 + 0.8 * brim, 0.3 * rise)
    under = bezier((0.9, 0.0), (1.0 + 0.4 * brim, 0.0), end, (outer, rise), 7)
    over = reverse((under[0] + (0.0, THICK), under[1]))
    edge_of = line((outer, rise), (outer, rise + THICK))
    flat = join(under, edge_of, over, line((0.9, THICK), (0.9, 0.0)))
    return [loft(shell(wall, THICK), size=size, closed=True), loft(flat, size=size, closed=True)]


def _sun_hat(rng: Generator) -> list[Part]:
    """Build a soft sun hat whose brim slopes down."""
    height, brim, drop = span(rng, 0.7, 1.1), span(rng, 0.25, 0.65), span(rng, 0.1, 0.5)
    size = _oval(rng)
    top = span(rng, 0.72, 0.98)
    low, high = drop + 0.85 * height, drop + height
    crown = bezier((top, low), (top, high), (0.6 * top, high), (0.0, high + 0.02), 6)
    wall = join(line((1.0 + brim, 0.0), (1.0, drop), (top, low)), crown)
    return [loft(shell(wall, THICK), size=size, closed=True)]


def _peak(rng: Generator, ahead: float) -> Part:
    """Build a cap's peak on the front half of a band of radius 1 about z = `ahead`.

    Seen from above it is a crescent: its inner edge follows the band, its outer edge reaches
    further to +z. It is arched: its height falls with x squared and linearly with z, down to the
    corners at y = 0.
    """
    half = math.radians(span(rng, 55, 80))
    reach, sharp = span(rng, 0.5, 1.0), span(rng, 0.5, 1.1)
    arch, slope = span(rng, 0.04, 0.3), span(rng, -0.02, 0.2)
    corner_z = 0.96 * math.cos(half)
    slope = min(slope, arch / (reach + 0.96 - corner_z))
    t = np.linspace(-1.0, 1.0, 25)
    bulge = np.maximum(np.cos(np.pi / 2 * t), 0.0) ** sharp
    x = 0.96 * np.sin(half * t)
    back = 0.96 * np.cos(half * t)
    share = np.linspace(0.0, 1.0, 5)[:, None]
    z = back + share * (0.03 + reach * bulge)
    x = x + 0.0 * z
    edge_x = 0.96 * math.sin(half)
    fall = arch / edge_x**2
    y = 0.012 + arch - fall * x**2 - slope * (z - corner_z) + slope * 0.03
    y = y - y.min() + 0.012
    up = np.stack([2 * fall * x, np.ones_like(x), slope + 0 * x], axis=-1)
    grid = np.stack([x, y, z + ahead], axis=-1)
    return _plate(grid, up, THICK)


def _plate(grid: Array, up: Array, thickness: float) -> Part:
    """Build a sheet over a grid of points: it extends upwards by `thickness`, with vertical sides.

    Args:
        grid: points of the lower side, (rows, columns, 3); rows go along +z, columns along +x, and
            the points of each column lie on a line.
        up: normals of the upper side, (rows, columns, 3). The vertical sides are flat shaded.
    """
    lift = np.array([0.0, thickness, 0.0])
    top = grid + lift
    sheets = [_sheet(top, up), _sheet(grid[:, ::-1], -up[:, ::-1])]
    # The border runs such that the outside is on its right, seen from above.
    border = np.concatenate([grid[0, :-1], grid[:-1, -1], grid[-1, :0:-1], grid[:0:-1, 0]])
    after = np.roll(border, -1, axis=0)
    along = after - border
    out = np.stack([along[:, 2], 0 * along[:, 1], -along[:, 0]], axis=1)
    out /= np.sqrt((out * out).sum(axis=1, keepdims=True))
    quads = np.stack([border, border + lift, after + lift, after], axis=1)
    halves = 4 * np.arange(len(quads))[:, None, None] + np.array([[0, 1, 2], [0, 2, 3]])
    sides = quads.reshape(-1, 3), halves.reshape(-1, 3), np.repeat(out, 4, axis=0)
    ends = np.concatenate([grid[0], grid[-1], top[0], top[-1]])
    return Part(*joined([*sheets, sides]), ends, np.zeros(len(ends)))


def _sheet(points: Array, normals: Array) -> tuple[Array, Array, Array]:
    """Return vertices, two triangles a cell, and normals of (rows, columns, 3) points."""
    normals = normals / np.sqrt((normals * normals).sum(axis=-1, keepdims=True))
    i = np.arange(len(points) - 1)[:, None, None]
    j = np.arange(points.shape[1] - 1)[:, None]
    rows, columns = i + np.array([0, 1, 1, 0, 1, 0]), j + np.array([0, 0, 1, 0, 1, 1])
    faces = (rows * points.shape[1] + columns).reshape(-1, 3)
    return points.reshape(-1, 3), faces, normals.reshape(-1, 3)
