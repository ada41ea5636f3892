"""Lamps that stand: a foot, a stem, and a shade or a globe; `desk_lamps` holds the others."""

import itertools
import math

import numpy as np

from scenegen.objects.families.parts.desk_lamps import bent, desk
from scenegen.objects.families.parts.draws import chance, pick, span
from scenegen.objects.families.parts.profiles import Curve, arc, bezier, join, line, polyline
from scenegen.objects.families.parts.shades import bowl, globe, shade
from scenegen.objects.families.parts.surfaces import Part, loft

Generator = np.random.Generator


def lamp(rng: Generator) -> list[Part]:
    """A lamp: with a shade on a stem, low or as high as a floor lamp; jointed or bent; a globe."""
    kind = pick(
        rng, ("table", "table", "table", "floor", "desk", "desk", "bent", "globe", "uplight")
    )
    if kind == "desk":
        return desk(rng)
    if kind == "bent":
        return bent(rng)
    tall = kind in ("floor", "uplight")
    height = span(rng, 2.4, 4.6) if tall else span(rng, 0.7, 2.0)
    radius = span(rng, 0.5, 1.0)  # of the shade
    parts = _pole(rng, height) if tall else _stand(rng, height, radius)
    if kind == "globe":
        return parts + globe(rng, height, radius * span(rng, 0.7, 1.0))
    if kind == "uplight":
        return parts + bowl(rng, height, radius)
    return parts + shade(rng, height, radius)


def _pole(rng: Generator, height: float) -> list[Part]:
    """A thin stem on a plate or on three legs."""
    thin = span(rng, 0.03, 0.07)
    if chance(rng, 0.35):
        spread, hub = span(rng, 0.5, 0.85), height * span(rng, 0.3, 0.95)
        angle = np.radians([90, 210, 330])
        feet = [(spread * math.cos(a), spread * math.sin(a)) for a in angle]
        lean = [(-x * 0.95 / hub, -z * 0.95 / hub) for x, z in feet]
        leg = line((1.2 * thin, 0.0), (thin, hub))
        return [
            loft(leg, at=feet, lean=lean, segments=16),
            loft(polyline((thin, hub - 0.15), (thin, height)), segments=16),
            loft(polyline((2.2 * thin, hub - 0.1), (2.2 * thin, hub + 0.05)), segments=16),
        ]
    plate, thick = span(rng, 0.35, 0.6), span(rng, 0.04, 0.15)
    corner = pick(rng, (1.0, 1.0, 0.1))
    foot = loft(polyline((plate, 0.0), (0.96 * plate, thick)), corner=corner)
    return [foot, loft(polyline((thin, 0.5 * thick), (thin, height)), segments=16)]


def _stand(rng: Generator, height: float, shade: float) -> list[Part]:
    """The body of a table lamp; a rod goes on from it to `height`."""
    style = pick(rng, ("vase", "vase", "gourd", "column", "block", "balls", "tripod"))
    top = 0.9 * height
    wide = shade * span(rng, 0.4, 0.8)
    rod = loft(polyline((0.05, 0.5 * top), (0.05, height)), segments=16)
    if style == "tripod":
        return [*_tripod(rng, top, wide), rod]
    if style == "column":
        thin, thick = span(rng, 0.05, 0.16), span(rng, 0.05, 0.16)
        profile = polyline((wide, 0.0), (wide * 0.95, thick), (thin, thick), (thin, top))
        return [loft(profile), rod]
    if style == "block":
        depth = span(rng, 0.6, 1.0)
        block = loft(
            polyline((wide, 0.0), (wide * span(rng, 0.5, 1.1), top)),
            size=(1.0, depth),
            corner=pick(rng, (0.0, 0.2)),
            segments=24,
        )
        return [block, rod]
    if style == "balls":
        return [*_balls(rng, top, wide), rod]
    neck, foot = wide * span(rng, 0.15, 0.45), wide * span(rng, 0.4, 0.9)
    if style == "vase":
        belly, high = wide * span(rng, 0.9, 1.5), span(rng, 0.2, 0.9)
        low = (belly, top * 0.45 * high)
        side = bezier((foot, 0.04), low, (belly, top * high), (neck, top), 16)
    else:
        waist, at = wide * span(rng, 0.3, 0.5), top * span(rng, 0.45, 0.6)
        upper = wide * span(rng, 0.6, 0.9)
        side = join(
            bezier((foot, 0.04), (1.4 * wide, 0.1 * top), (1.4 * wide, at), (waist, at), 9),
            bezier((waist, at), (1.3 * upper, at), (1.3 * upper, top), (neck, top), 9),
        )
    return [loft(join(line((foot, 0.0), (foot, 0.04)), side)), rod]


def _tripod(rng: Generator, top: float, wide: float) -> list[Part]:
    spread, thin = wide * span(rng, 1.0, 1.5), span(rng, 0.04, 0.09)
    angle = np.radians([90, 210, 330])
    feet = [(spread * math.cos(a), spread * math.sin(a)) for a in angle]
    lean = [(-x * 0.9 / top, -z * 0.9 / top) for x, z in feet]
    hub = loft(polyline((2.6 * thin, top - 0.12), (2.6 * thin, top + 0.02)), segments=20)
    return [loft(line((thin, 0.0), (thin, top)), at=feet, lean=lean, segments=16), hub]


def _balls(rng: Generator, top: float, wide: float) -> list[Part]:
    """Balls or discs stacked on a foot."""
    count = 1 + int(4 * rng.random())
    half = (top - 0.1) / count / 2
    radius = min(wide, half * span(rng, 1.0, 1.6))
    shrink = span(rng, 0.75, 1.0)
    pieces = [polyline((wide, 0.0), (0.95 * wide, 0.1), (0.3 * radius, 0.1))]
    for i in range(count):
        bulge, middle = radius * shrink**i, 0.1 + half * (2 * i + 1)
        piece = arc((0.0, middle), (bulge, half), -72, 72, 7)
        pieces.append(piece)
    return [loft(_bridged(pieces), segments=28)]


def _bridged(pieces: list[Curve]) -> Curve:
    """Curves joined by straight pieces."""
    joined = [pieces[0]]
    for before, piece in itertools.pairwise(pieces):
        start, end = (tuple(float(v) for v in at) for at in (before[0][-1], piece[0][0]))
        joined += [line((start[0], start[1]), (end[0], end[1])), piece]
    return join(*joined)
