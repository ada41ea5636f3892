"""Legs of chairs, from the floor to the seat."""

import math

import numpy as np

from scenegen.objects.families.parts.boxes import box, boxes
from scenegen.objects.families.parts.draws import chance, pick, span
from scenegen.objects.families.parts.moves import buried
from scenegen.objects.families.parts.profiles import arc, bezier, fillet, join, line, polyline
from scenegen.objects.families.parts.surfaces import Part, loft
from scenegen.objects.families.parts.sweeps import tube

Generator = np.random.Generator
Corners = list[tuple[float, float, float]]
HALF = 1.0  # half the seat's width


def legs(rng: Generator, width: float, depth: float, under: float) -> list[Part]:
    """Legs up to the seat's underside, sunk a little into it."""
    top = under + 0.03
    style = pick(
        rng, ("straight", "straight", "splayed", "turned", "star", "sled", "frame", "panel")
    )
    if style == "star":
        return _star(rng, top)
    thin = span(rng, 0.06, 0.14)
    x, z = width - thin - 0.02, depth - thin - 0.02
    if style == "sled":
        bar = 0.7 * thin
        corners = [(z, top), (z, bar), (-z, bar), (-z, top)]
        path = fillet(corners, 0.25, 5)
        return [
            tube(path, bar, origin=(side * x, 0.0, 0.0), across=(0.0, 0.0, 1.0)) for side in (1, -1)
        ]
    if style == "frame":  # cantilever: no legs at the back
        bar = 0.7 * thin
        corners = [(-0.6 * z, top - bar), (z, top - bar), (z, bar), (-z, bar)]
        path = fillet(corners, 0.3, 5)
        pair = [
            tube(path, bar, origin=(side * x, 0.0, 0.0), across=(0.0, 0.0, 1.0)) for side in (1, -1)
        ]
        return [*pair, boxes([box((-x, 0.0, -z), (x, 2 * bar, -z + 2 * bar))])]
    if style == "panel":
        wall = 0.7 * thin
        panels = [box((s * x - wall, 0.0, -z), (s * x + wall, top, z)) for s in (1, -1)]
        if chance(rng, 0.5):
            panels.append(box((-x, 0.3 * top, -0.1), (x, 0.6 * top, 0.1)))
        return [boxes(panels)]
    corners = [(sx * x, sz * z) for sx in (1.0, -1.0) for sz in (1.0, -1.0)]
    out = span(rng, 0.05, 0.3) if style == "splayed" else 0.0
    feet = [(cx * (1 + out), cz * (1 + 0.7 * out)) for cx, cz in corners]
    lean = [
        ((cx - fx) / top, (cz - fz) / top) for (cx, cz), (fx, fz) in zip(corners, feet, strict=True)
    ]
    if style == "turned":
        at = span(rng, 0.35, 0.75) * top
        bulge = 1.7 * thin
        side = join(
            line((0.6 * thin, 0.0), (0.7 * thin, 0.6 * at)),
            bezier((0.7 * thin, 0.6 * at), (bulge, 0.8 * at), (bulge, at), (0.8 * thin, at), 6),
            line((0.8 * thin, at), (thin, top)),
        )
        legs = loft(side, at=feet, segments=16)
    else:
        corner = pick(rng, (0.0, 1.0))
        foot = span(rng, 0.5, 1.0) * thin
        legs = loft(line((foot, 0.0), (thin, top)), at=feet, lean=lean, corner=corner, segments=16)
    parts = [legs]
    if chance(rng, 0.45):  # stretchers between the legs
        y, half = span(rng, 0.15, 0.45) * top, 0.45 * thin
        share = 1.0 + out * (1.0 - y / top)
        a, b = x * share, z * (1.0 + 0.7 * out * (1.0 - y / top))
        rails = [box((s * a - half, y - half, -b), (s * a + half, y + half, b)) for s in (1, -1)]
        if chance(rng, 0.5):
            rails.append(box((-a, y - half, -half), (a, y + half, half)))
        else:
            rails += [
                box((-a, y - half, s * b - half), (a, y + half, s * b + half)) for s in (1, -1)
            ]
        parts.append(buried(boxes(rails)))
    return parts


def _star(rng: Generator, top: float) -> list[Part]:
    """A column on a star of arms with castors, or on a plate."""
    thin = span(rng, 0.08, 0.16)
    if chance(rng, 0.35):
        plate = span(rng, 0.6, 0.9)
        side = join(
            polyline((plate, 0.0), (plate, 0.06)),
            bezier((plate, 0.06), (0.3, 0.1), (thin, 0.15), (thin, 0.4), 6),
        )
        return [loft(join(side, line((thin, 0.4), (thin, top))), segments=32)]
    reach, arms = span(rng, 0.75, 1.0), pick(rng, (4, 5, 5))
    ball = 0.11
    parts = [loft(polyline((thin, ball), (thin, top)), segments=20)]
    bars, wheels = [], []
    for i in range(arms):
        angle = 2 * math.pi * (i + 0.25) / arms
        c, s = math.cos(angle), math.sin(angle)
        wheels.append((reach * c, reach * s))
        bar: Corners = []
        for near, far in ((ball, ball), (2.2 * ball, 1.6 * ball)):
            for along, across in ((0.0, -0.07), (0.0, 0.07), (reach, 0.07), (reach, -0.07)):
                y = near if along == 0.0 else far
                bar.append((along * c - across * s, y, along * s + across * c))
        bars.append(bar)
    castor = arc((0.0, ball), ball, -90, 90, 6)
    return [*parts, boxes(bars), loft(castor, at=wheels, segments=16)]
