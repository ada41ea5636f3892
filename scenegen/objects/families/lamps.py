"""Lamps: a shade, globe or bowl on a standing stem, or a head at the end of an arm towards +z."""

import itertools
import math
from dataclasses import replace

import numpy as np
from numpy.random import Generator

from scenegen.objects.families.parts.boxes import box, boxes
from scenegen.objects.families.parts.draws import chance, pick, span
from scenegen.objects.families.parts.moves import buried, moved, turn_about_x
from scenegen.objects.families.parts.profiles import Curve, arc, bezier, join, limited, line
from scenegen.objects.families.parts.surfaces import Part, loft, made_of
from scenegen.objects.families.parts.sweeps import tube
from scenegen.objects.families.parts.walls import ring


def lamp(rng: Generator) -> list[Part]:
    """Build a table, floor, desk, arc or globe lamp, or an uplight."""
    kinds = ("table", "table", "table", "floor", "desk", "desk", "bent", "globe", "uplight")
    kind = pick(rng, kinds)
    if kind == "desk":
        return _desk(rng)
    if kind == "bent":
        return _bent(rng)
    tall = kind in ("floor", "uplight")
    height = span(rng, 2.4, 4.6) if tall else span(rng, 0.7, 2.0)
    radius = span(rng, 0.5, 1.0)  # radius of the shade
    parts = _pole(rng, height) if tall else _stand(rng, height, radius)
    if kind == "globe":
        return parts + _globe(rng, height, radius * span(rng, 0.7, 1.0))
    if kind == "uplight":
        return parts + _bowl(rng, height, radius)
    return parts + _shade(rng, height, radius)


def _pole(rng: Generator, height: float) -> list[Part]:
    """Build a floor lamp's thin stem on a plate or on three legs."""
    thin = span(rng, 0.03, 0.07)
    if chance(rng, 0.35):
        spread, hub = span(rng, 0.5, 0.85), height * span(rng, 0.3, 0.95)
        angle = np.radians([90, 210, 330])
        feet = [(spread * math.cos(a), spread * math.sin(a)) for a in angle]
        lean = [(-x * 0.95 / hub, -z * 0.95 / hub) for x, z in feet]
        leg = line((1.2 * thin, 0.0), (thin, hub))
        return [
            loft(leg, at=feet, lean=lean, segments=16),
            loft(line((thin, hub - 0.15), (thin, height)), segments=16),
            loft(line((2.2 * thin, hub - 0.1), (2.2 * thin, hub + 0.05)), segments=16),
        ]
    plate, thick = span(rng, 0.35, 0.6), span(rng, 0.04, 0.15)
    corner = pick(rng, (1.0, 1.0, 0.1))
    foot = loft(line((plate, 0.0), (0.96 * plate, thick)), corner=corner)
    return [foot, loft(line((thin, 0.5 * thick), (thin, height)), segments=16)]


def _stand(rng: Generator, height: float, shade: float) -> list[Part]:
    """Build the body of a table lamp, and a rod from it up to `height`."""
    style = pick(rng, ("vase", "vase", "gourd", "column", "block", "balls", "tripod"))
    top = 0.9 * height
    wide = shade * span(rng, 0.4, 0.8)
    rod = loft(line((0.05, 0.5 * top), (0.05, height)), segments=16)
    if style == "tripod":
        return [*_tripod(rng, top, wide), rod]
    if style == "column":
        thin, thick = span(rng, 0.05, 0.16), span(rng, 0.05, 0.16)
        profile = line((wide, 0.0), (wide * 0.95, thick), (thin, thick), (thin, top))
        return [loft(profile), rod]
    if style == "block":
        depth = span(rng, 0.6, 1.0)
        side = line((wide, 0.0), (wide * span(rng, 0.5, 1.1), top))
        corner = pick(rng, (0.0, 0.2))
        return [*made_of("body", loft(side, size=(1.0, depth), corner=corner, segments=24)), rod]
    if style == "balls":
        return [*made_of("body", *_balls(rng, top, wide)), rod]
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
    return [*made_of("body", loft(join(line((foot, 0.0), (foot, 0.04)), side))), rod]


def _tripod(rng: Generator, top: float, wide: float) -> list[Part]:
    spread, thin = wide * span(rng, 1.0, 1.5), span(rng, 0.04, 0.09)
    angle = np.radians([90, 210, 330])
    feet = [(spread * math.cos(a), spread * math.sin(a)) for a in angle]
    lean = [(-x * 0.9 / top, -z * 0.9 / top) for x, z in feet]
    hub = loft(line((2.6 * thin, top - 0.12), (2.6 * thin, top + 0.02)), segments=20)
    return [loft(line((thin, 0.0), (thin, top)), at=feet, lean=lean, segments=16), hub]


def _balls(rng: Generator, top: float, wide: float) -> list[Part]:
    """Build a stack of balls or discs on a foot."""
    count = 1 + int(4 * rng.random())
    half = (top - 0.1) / count / 2
    radius = min(wide, half * span(rng, 1.0, 1.6))
    shrink = span(rng, 0.75, 1.0)
    pieces = [line((wide, 0.0), (0.95 * wide, 0.1), (0.3 * radius, 0.1))]
    for i in range(count):
        bulge, middle = radius * shrink**i, 0.1 + half * (2 * i + 1)
        pieces.append(arc((0.0, middle), (bulge, half), -72, 72, 7))
    return [loft(_bridged(pieces), segments=28)]


def _bridged(pieces: list[Curve]) -> Curve:
    """Join curves that do not touch by straight pieces."""
    joined = [pieces[0]]
    for before, piece in itertools.pairwise(pieces):
        start, end = (tuple(float(v) for v in at) for at in (before[0][-1], piece[0][0]))
        joined += [line((start[0], start[1]), (end[0], end[1])), piece]
    return join(*joined)


def _shade(rng: Generator, height: float, radius: float) -> list[Part]:
    """Build a shade that is open above and below, on a cross that rests on the stem.

    The stem's radius is 0.05, and so it is for `_globe` and `_bowl`.
    """
    rise = min(radius * span(rng, 0.7, 1.7), height * span(rng, 0.55, 0.8))
    low = height - rise * span(rng, 0.55, 0.9)
    high, thick = low + rise, 0.03
    narrow = radius * pick(rng, (span(rng, 0.25, 0.6), span(rng, 0.6, 1.0), 1.0))
    style = pick(rng, ("straight", "straight", "bell", "dome"))
    if style == "straight" or narrow > 0.8 * radius:
        wall = line((radius, low), (narrow, high))
    elif style == "bell":
        waist = narrow + 0.1 * (radius - narrow)
        begin, end = (0.4 * radius + 0.6 * waist, low + 0.3 * rise), (narrow, low + 0.5 * rise)
        wall = bezier((radius, low), begin, end, (narrow, high), 8)
    else:
        begin, end = (radius, low + 0.6 * rise), ((radius + narrow) / 2, high)
        wall = bezier((radius, low), begin, end, (narrow, high), 8)
    outline = pick(rng, ("round", "round", "round", "square", "oval"))
    size, corner = (1.0, 1.0), 1.0
    if outline == "square":
        corner = pick(rng, (0.0, 0.25))
    elif outline == "oval":
        size, corner = (1.0, span(rng, 0.55, 0.8)), 0.5
    level = high - 0.12 * rise
    bar = 0.015
    levels = [level, level + 2 * bar]
    level_radius = float(np.interp(levels, wall[0][:, 1], wall[0][:, 0]).min()) - 0.01
    depth = level_radius * size[1]
    cross = [
        box((-level_radius, level, -bar), (level_radius, level + 2 * bar, bar)),
        box((-bar, level, -depth), (bar, level + 2 * bar, depth)),
    ]
    stem = line((0.05, height - 0.05), (0.05, max(level + 2 * bar, height)))
    bulb = arc((0.0, level - 0.2 * rise), 0.16 * radius + 0.03, -80, 90, 8)
    parts = [
        *made_of("shade", loft(ring(wall, thick), size=size, corner=corner, closed=True)),
        buried(boxes(cross)),
        loft(stem, segments=16),
        *made_of("glow", loft(bulb, segments=16)),
    ]
    if chance(rng, 0.3):  # a finial
        ball = span(rng, 0.05, 0.1)
        parts += [
            loft(line((0.03, level), (0.03, high + ball)), segments=16),
            loft(arc((0.0, high + 1.5 * ball), ball, -80, 90, 8), segments=16),
        ]
    return parts


def _globe(rng: Generator, height: float, radius: float) -> list[Part]:
    """Build a ball or an egg on a short collar."""
    tall = radius * span(rng, 0.8, 1.4)
    collar = 0.4 * radius
    ball = arc((0.0, height + 0.9 * tall), (radius, tall), -75, 90, 16)
    neck = loft(line((collar, height - 0.08), (collar, height + 0.08 * tall)))
    return [neck, *made_of("glow", loft(ball))]


def _bowl(rng: Generator, height: float, radius: float) -> list[Part]:
    """Build an uplight's bowl, which is open upwards."""
    rise = radius * span(rng, 0.35, 0.9)
    low, bend = height - 0.03, (radius, height + 0.4 * rise)
    begin = (radius * span(rng, 0.3, 1.0), low)
    wall = bezier((0.06, low), begin, bend, (radius, height + rise), 10)
    bulb = loft(arc((0.0, height), 0.12, -80, 90, 6), segments=16)
    return [loft(ring(wall, 0.03), closed=True), *made_of("glow", bulb)]


def _head(rng: Generator, room: float) -> tuple[Curve, float]:
    """Return a desk lamp's head as a profile, and its height; both fit into `room`."""
    radius, rise = span(rng, 0.35, 0.65), span(rng, 0.4, 0.8)
    shrink = min(1.0, room / (radius + rise))
    radius, rise = radius * shrink, rise * shrink
    crown = radius * span(rng, 0.3, 0.55)
    style = pick(rng, ("cone", "dome", "drum"))
    if style == "cone":
        wall = line((radius, 0.0), (crown, rise))
    elif style == "dome":
        wall = bezier((radius, 0.0), (radius, 0.6 * rise), (crown, 0.9 * rise), (crown, rise), 5)
    else:
        wall = line((radius, 0.0), (0.9 * radius, rise))
    return wall, rise


def _hang(rng: Generator, at: tuple[float, float], tilt: float) -> list[Part]:
    """Build a desk lamp's head with its top at (z, y), tilted so that it opens down and forward."""
    wall, rise = _head(rng, 0.8 * at[1])
    crown = float(wall[0][-1, 0])
    turn = turn_about_x(-tilt)
    # This moves the top of the head, (0, rise, 0), to the end of the arm.
    offset = (0.0, at[1] - rise * math.cos(tilt), at[0] + rise * math.sin(tilt))
    lid = loft(line((crown + 0.01, rise - 0.05), (0.8 * crown, rise + 0.08)), segments=24)
    bulb = loft(arc((0.0, 0.45 * rise), 0.6 * crown, -80, 80, 8), segments=16)
    bulb = replace(bulb, material="glow")
    stem = loft(line((0.3 * crown, 0.5 * rise), (0.3 * crown, rise)), segments=16)
    parts = [loft(ring(wall, 0.025), closed=True, segments=32), lid, buried(bulb), buried(stem)]
    return [moved(part, offset, turn) for part in parts]


def _desk(rng: Generator) -> list[Part]:
    """Build a desk lamp: two straight arms with joints on a heavy foot."""
    plate, thick = span(rng, 0.38, 0.65), span(rng, 0.06, 0.16)
    lower, upper = span(rng, 0.7, 1.5), span(rng, 0.6, 1.3)
    back, ahead = math.radians(span(rng, 5, 40)), math.radians(span(rng, 25, 75))
    thin = span(rng, 0.03, 0.05)
    foot = (-0.4 * plate, thick)
    elbow = (foot[0] - lower * math.sin(back), foot[1] + lower * math.cos(back))
    wrist = (elbow[0] + upper * math.sin(ahead), elbow[1] + upper * math.cos(ahead))
    corner = pick(rng, (1.0, 1.0, 0.15))
    parts = [loft(line((plate, 0.0), (0.94 * plate, thick)), corner=corner)]
    arms = [(foot[0], 0.7 * thick), elbow, wrist]
    double = chance(rng, 0.4)
    for start, end in itertools.pairwise(arms):
        for x in (-0.07, 0.07) if double else (0.0,):
            way = line((start[0], start[1]), (end[0], end[1]))
            arm = tube(way, thin, origin=(x, 0.0, 0.0), across=(0.0, 0.0, 1.0))
            parts.append(buried(arm))  # its ends lie inside the foot and the knobs
    knob = 1.8 * thin + (0.07 if double else 0.0)
    for z, y in (elbow, wrist):
        parts.append(loft(arc((0.0, y), knob, -90, 90, 6), at=(0.0, z), segments=16))
    return parts + _hang(rng, wrist, math.radians(span(rng, 0, 50)))


def _bent(rng: Generator) -> list[Part]:
    """Build a lamp on one bent tube, from a gooseneck to an arc lamp."""
    plate, thick = span(rng, 0.4, 0.7), span(rng, 0.06, 0.2)
    height, reach = span(rng, 1.4, 3.8), span(rng, 0.7, 1.8)
    thin = span(rng, 0.035, 0.06)
    end = (reach, height * span(rng, 0.62, 0.92))
    rise = (span(rng, -0.5, 0.1), height * 1.15)
    fall = (reach * span(rng, 0.6, 1.0), height * 1.2)
    path = bezier((0.0, 0.7 * thick), rise, fall, end, 16)
    thin = limited(path, thin)
    along = path[1][-1] / math.hypot(*path[1][-1])
    tilt = math.atan2(float(along[0]), -float(along[1])) * span(rng, 0.0, 1.0)
    foot = loft(line((plate, 0.0), (0.94 * plate, thick)))
    arm = tube(path, thin, across=(0.0, 0.0, 1.0))
    joint = loft(arc((0.0, end[1]), 1.8 * thin, -90, 90, 8), at=(0.0, end[0]), segments=16)
    return [foot, arm, joint, *_hang(rng, end, tilt)]
