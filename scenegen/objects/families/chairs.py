"""Chairs: a seat on legs, with a back and sometimes arms. The seat faces +z; the back is at -z."""

import math

import numpy as np
from numpy.random import Generator

from scenegen.objects.families.parts.boxes import box, boxes, spoke
from scenegen.objects.families.parts.draws import chance, pick, span
from scenegen.objects.families.parts.moves import buried
from scenegen.objects.families.parts.profiles import arc, bezier, fillet, join, line
from scenegen.objects.families.parts.surfaces import Part, loft, made_of
from scenegen.objects.families.parts.sweeps import tube

Corners = list[tuple[float, float, float]]
HALF = 1.0  # half the seat's width


def chair(rng: Generator) -> list[Part]:
    """Build a chair, an armchair, a bar chair or an upholstered tub chair."""
    high = math.exp(span(rng, math.log(1.2), math.log(2.9)))  # height of the seat
    depth = span(rng, 0.75, 1.15)  # half the seat's depth
    thick = span(rng, 0.08, 0.3)
    if chance(rng, 0.15):
        return _tub(rng)
    style = pick(rng, ("square", "square", "round", "soft"))
    seat = _seat(style, depth, high, thick)
    under = high - thick
    shrink = 0.8 if style == "round" else 1.0  # a round seat's legs and back attach further in
    parts = _legs(rng, shrink, shrink * depth, under)
    rise = span(rng, 1.1, 2.6)
    upright, lean = _back(rng, depth, high, rise, 0.95 * shrink)
    parts = [*made_of("seat", seat), *made_of("legs", *parts), *made_of("back", *upright)]
    if style != "round" and chance(rng, 0.4):
        parts += made_of("legs", *_arms(rng, depth, high, lean, rise))
    return parts


def _seat(style: str, depth: float, high: float, thick: float) -> Part:
    low = high - thick
    if style == "square":
        return boxes([box((-HALF, low, -depth), (HALF, high, depth))])
    if style == "round":
        side = line((HALF - 0.05, low), (HALF, high))
        return loft(side, base=(0.0, depth - HALF, 0.6 * min(depth, HALF) - HALF))
    edge = 0.49 * thick
    side = join(
        arc((HALF - edge, low + edge), edge, -90, 0, 4),
        line((HALF, low + edge), (HALF, high - edge)),
        arc((HALF - edge, high - edge), edge, 0, 90, 4),
    )
    return loft(side, base=(0.0, depth - HALF, 0.25 - HALF), segments=32)


def _tub(rng: Generator) -> list[Part]:
    """Build an upholstered tub chair, whose arms and back are one bent wall about the seat."""
    high, rise = span(rng, 0.75, 1.2), span(rng, 0.5, 1.3)
    radius, thick = span(rng, 0.9, 1.15), span(rng, 0.12, 0.25)
    foot = span(rng, 0.15, 0.45)
    deep = span(rng, 0.3, 0.9)
    path = join(
        (np.array([[radius, deep]]), np.array([[0.0, -1.0]])),
        arc((0.0, 0.0), radius, 0, -180, 20),
        (np.array([[-radius, deep]]), np.array([[0.0, 1.0]])),
    )
    tall, middle = (high + rise - foot) / 2, (0.0, (high + rise + foot) / 2, 0.0)
    wall = tube(path, tall, thick, origin=middle, up=(0.0, 0.0, 1.0), corner=0.8 * thick)
    edge = 0.12
    rim = arc((1.0 - edge, high - edge), edge, 0, 90, 4)
    cushion = join(line((1.0, foot + 0.05), (1.0, high - edge)), rim)
    size = radius - 0.02
    half = (radius + deep) / 2
    base = (size - 1.0, half - 1.0, 0.3 - 1.0)
    seat = loft(cushion, base=base, at=(0.0, deep - half + 0.05), segments=32)
    x, z = 0.7 * radius, 0.55 * radius
    if chance(rng, 0.3):
        plate = line((0.7, 0.0), (0.7, 0.06), (0.12, 0.08), (0.12, foot + 0.1))
        return made_of("tub", wall, seat) + made_of("legs", loft(plate, segments=32))
    spots = [(x, 0.7 * deep), (-x, 0.7 * deep), (x, -z), (-x, -z)]
    feet = loft(line((0.06, 0.0), (0.1, foot + 0.15)), at=spots, segments=16)
    return made_of("tub", wall, seat) + made_of("legs", feet)


def _legs(rng: Generator, width: float, depth: float, under: float) -> list[Part]:
    """Build legs that reach up to the seat's underside and a little into it."""
    top = under + 0.03
    styles = ("straight", "straight", "splayed", "turned", "star", "sled", "frame", "panel")
    style = pick(rng, styles)
    if style == "star":
        return _star(rng, top)
    thin = span(rng, 0.06, 0.14)
    x, z = width - thin - 0.02, depth - thin - 0.02
    if style in ("sled", "frame"):
        bar = 0.7 * thin
        path = fillet([(z, top), (z, bar), (-z, bar), (-z, top)], 0.25, 5)
        if style == "frame":  # a cantilever chair has no legs at the back
            path = fillet([(-0.6 * z, top - bar), (z, top - bar), (z, bar), (-z, bar)], 0.3, 5)
        sides = ((x, 0.0, 0.0), (-x, 0.0, 0.0))
        parts = [tube(path, bar, origin=side, across=(0.0, 0.0, 1.0)) for side in sides]
        cross = boxes([box((-x, 0.0, -z), (x, 2 * bar, -z + 2 * bar))])
        return [*parts, cross] if style == "frame" else parts
    if style == "panel":
        wall = 0.7 * thin
        panels = [box((s * x - wall, 0.0, -z), (s * x + wall, top, z)) for s in (1, -1)]
        if chance(rng, 0.5):
            panels.append(box((-x, 0.3 * top, -0.1), (x, 0.6 * top, 0.1)))
        return [boxes(panels)]
    corners = [(sx * x, sz * z) for sx in (1.0, -1.0) for sz in (1.0, -1.0)]
    out = span(rng, 0.05, 0.3) if style == "splayed" else 0.0
    feet = [(cx * (1 + out), cz * (1 + 0.7 * out)) for cx, cz in corners]
    lean = np.subtract(corners, feet) / top
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
            low, high = y - half, y + half
            rails += [box((-a, low, s * b - half), (a, high, s * b + half)) for s in (1, -1)]
        parts.append(buried(boxes(rails)))
    return parts


def _star(rng: Generator, top: float) -> list[Part]:
    """Build a column on a star of arms with castors, or on a plate."""
    thin = span(rng, 0.08, 0.16)
    if chance(rng, 0.35):
        plate = span(rng, 0.6, 0.9)
        side = join(
            line((plate, 0.0), (plate, 0.06)),
            bezier((plate, 0.06), (0.3, 0.1), (thin, 0.15), (thin, 0.4), 6),
        )
        return [loft(join(side, line((thin, 0.4), (thin, top))), segments=32)]
    reach, arms = span(rng, 0.75, 1.0), pick(rng, (4, 5, 5))
    ball = 0.11
    parts = [loft(line((thin, ball), (thin, top)), segments=20)]
    bars, wheels = [], []
    for i in range(arms):
        angle = 2 * math.pi * (i + 0.25) / arms
        c, s = math.cos(angle), math.sin(angle)
        wheels.append((reach * c, reach * s))
        bars.append(spoke(0.0, angle, reach, 0.07, ((ball, ball), (2.2 * ball, 1.6 * ball))))
    castor = arc((0.0, ball), ball, -90, 90, 6)
    return [*parts, boxes(bars), loft(castor, at=wheels, segments=16)]


def _back(
    rng: Generator, depth: float, high: float, rise: float, most: float
) -> tuple[list[Part], float]:
    """Build a back up to `rise` above the seat; also return its lean towards -z per unit of y."""
    lean = span(rng, 0.0, 0.3)
    low, top = high - 0.06, high + rise
    half, z = span(rng, 0.04, 0.09), -depth + 0.1
    wide = most * span(rng, 0.8, 1.0)

    def at(y: float) -> float:
        return z - lean * (y - low)

    def slab(left: float, right: float, bottom: float, upper: float, thin: float) -> Corners:
        """Return the corners of a board in the plane of the back."""
        start = at(bottom)
        shift = (0.0, at(upper) - start)
        return box((left, bottom, start - thin), (right, upper, start + thin), shift)

    style = pick(rng, ("solid", "slats", "ladder", "hoop", "pad", "cross", "open"))
    if style == "solid":
        return [boxes([slab(-wide, wide, low, top, half)])], lean
    if style == "hoop":
        return _hoop(rng, low, top, z, lean, wide), lean
    post = span(rng, 0.06, 0.12)
    frame = [  # its convex hull contains the thinner boards between
        slab(s * wide - post * (1 + s), s * wide + post * (1 - s), low, top, 1.1 * half)
        for s in (1, -1)
    ]
    inner, within = wide - post, []
    if style == "pad":
        bottom, upper = high + rise * span(rng, 0.1, 0.5), top + 0.05
        pad = slab(-wide * 1.02, wide * 1.02, bottom, upper, half * 1.8)
        return [boxes([*frame, pad])], lean
    rail = span(rng, 0.1, 0.35)
    within.append(slab(-inner, inner, top - rail, top - 0.01, half))
    if style == "slats":
        count = 2 + int(6 * rng.random())
        thin = inner / count * span(rng, 0.25, 0.75)
        for i in range(count):
            x = inner * (2 * (i + 0.5) / count - 1)
            within.append(slab(x - thin, x + thin, low, top - rail + 0.02, 0.6 * half))
    elif style == "ladder":
        count = 1 + int(4 * rng.random())
        gap = (rise - rail) / (count + 0.5)
        thin = gap * span(rng, 0.2, 0.35)
        for i in range(count):
            y = high + gap * (i + 0.6)
            within.append(slab(-inner, inner, y - thin, y + thin, 0.7 * half))
    elif style == "cross":
        y = high + 0.2 * rise
        within.append(slab(-inner, inner, y - 0.06, y + 0.06, 0.7 * half))
        for s in (1.0, -1.0):
            bar = slab(-0.08, 0.08, y, top - rail + 0.02, 0.5 * half)
            move = s * (inner - 0.08)
            within.append([(x - move, y, z) for x, y, z in bar[:4]])
            within[-1] += [(x + move, y, z) for x, y, z in bar[4:]]
    else:
        y = high + span(rng, 0.3, 0.5) * rise
        within.append(slab(-inner, inner, y - 0.08, y + 0.08, 0.8 * half))
    return [boxes(frame), buried(boxes(within))], lean


def _hoop(rng: Generator, low: float, top: float, z: float, lean: float, wide: float) -> list[Part]:
    """Build a back of a bent bow with spindles or a board inside."""
    up = np.array([0.0, 1.0, -lean]) / math.hypot(1.0, lean)
    length = (top - low) * math.hypot(1.0, lean)
    flare = wide * span(rng, 0.85, 1.15)
    bar = span(rng, 0.05, 0.09)
    peak, foot = length * 4 / 3, wide * 0.8
    bow = bezier((foot, 0.0), (flare, peak), (-flare, peak), (-foot, 0.0), 16)
    parts = [tube(bow, bar, origin=(0.0, low, z), up=(0.0, float(up[1]), float(up[2])))]
    count = pick(rng, (1, 3, 4, 5, 6, 7))
    bars = []
    for i in range(count):
        x = 0.75 * wide * (2 * (i + 0.5) / count - 1)
        thin = 0.25 * wide if count == 1 else 0.035
        points = bow[0][bow[0][:, 1] > 0.5 * length]
        ends = [-abs(x) - thin, abs(x) + thin]  # the bow must cover the board's whole top
        reach = float(np.interp(ends, -points[:, 0], points[:, 1]).min())
        height = reach * float(up[1])
        start, end = (x - thin, low, z - 0.03), (x + thin, low + height, z + 0.03)
        bars.append(box(start, end, (0.0, -lean * height)))
    return [*parts, buried(boxes(bars))]


def _arms(rng: Generator, depth: float, high: float, lean: float, rise: float) -> list[Part]:
    """Build arm rests that reach from the back to posts near the front."""
    y = high + min(span(rng, 0.5, 0.8), 0.75 * rise)
    back = -depth + 0.1 - lean * (y - high)
    front = depth * span(rng, 0.5, 0.9)
    x, wide = HALF - 0.06, span(rng, 0.07, 0.14)
    if chance(rng, 0.3):
        path = fillet([(back, y), (front, y), (front, high - 0.03)], span(rng, 0.1, 0.3), 5)
        return [
            tube(path, wide, 0.06, origin=(s * x, 0.0, 0.0), across=(0.0, 0.0, 1.0), corner=0.04)
            for s in (1, -1)
        ]
    shapes = []
    solid = chance(rng, 0.3)
    for s in (1, -1):
        shapes.append(box((s * x - wide, y - 0.08, back), (s * x + wide, y, front)))
        start = back if solid else front - 2.2 * wide
        low, top = (s * x - 0.6 * wide, high - 0.04), (s * x + 0.6 * wide, y - 0.04)
        shapes.append(box((*low, start + 0.02), (*top, front - 0.03)))
    return [boxes(shapes)]
