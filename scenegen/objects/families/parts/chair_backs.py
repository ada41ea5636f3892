"""Backs and arms of chairs. The back stands at -z."""

import math

import numpy as np

from scenegen.objects.families.parts.boxes import box, boxes
from scenegen.objects.families.parts.draws import chance, pick, span
from scenegen.objects.families.parts.moves import buried
from scenegen.objects.families.parts.profiles import bezier, fillet
from scenegen.objects.families.parts.surfaces import Part
from scenegen.objects.families.parts.sweeps import tube

Generator = np.random.Generator
Corners = list[tuple[float, float, float]]
HALF = 1.0  # half the seat's width


def back(
    rng: Generator, depth: float, high: float, rise: float, most: float
) -> tuple[list[Part], float]:
    """A back from below the seat's top up to `rise` above it, and how it leans to -z per y."""
    lean = span(rng, 0.0, 0.3)
    low, top = high - 0.06, high + rise
    half, z = span(rng, 0.04, 0.09), -depth + 0.1
    wide = most * span(rng, 0.8, 1.0)

    def at(y: float) -> float:
        return z - lean * (y - low)

    def slab(left: float, right: float, bottom: float, upper: float, thin: float) -> Corners:
        """A board in the plane of the back."""
        start = at(bottom)
        shift = (0.0, at(upper) - start)
        return box((left, bottom, start - thin), (right, upper, start + thin), shift)

    style = pick(rng, ("solid", "slats", "ladder", "hoop", "pad", "cross", "open"))
    if style == "solid":
        return [boxes([slab(-wide, wide, low, top, half)])], lean
    if style == "hoop":
        return _hoop(rng, (low, top), z, lean, wide), lean
    post = span(rng, 0.06, 0.12)
    frame = [  # holds all that is thinner
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
            within.append(
                [(px + (-move if i < 4 else move), py, pz) for i, (px, py, pz) in enumerate(bar)]
            )
    else:
        y = high + span(rng, 0.3, 0.5) * rise
        within.append(slab(-inner, inner, y - 0.08, y + 0.08, 0.8 * half))
    return [boxes(frame), buried(boxes(within))], lean


def _hoop(
    rng: Generator, span_y: tuple[float, float], z: float, lean: float, wide: float
) -> list[Part]:
    """A bent bow with spindles or a board within."""
    low, top = span_y
    up = np.array([0.0, 1.0, -lean]) / math.hypot(1.0, lean)
    frame = ((1.0, 0.0, 0.0), (0.0, float(up[1]), float(up[2])))
    length = (top - low) * math.hypot(1.0, lean)
    flare = wide * span(rng, 0.85, 1.15)
    bar = span(rng, 0.05, 0.09)
    bow = bezier(
        (wide * 0.8, 0.0), (flare, length * 4 / 3), (-flare, length * 4 / 3), (-wide * 0.8, 0.0), 16
    )
    parts = [tube(bow, bar, origin=(0.0, low, z), across=frame[0], up=frame[1])]
    count = pick(rng, (1, 3, 4, 5, 6, 7))
    bars = []
    for i in range(count):
        x = 0.75 * wide * (2 * (i + 0.5) / count - 1)
        thin = 0.25 * wide if count == 1 else 0.035
        points = bow[0][bow[0][:, 1] > 0.5 * length]
        ends = [-abs(x) - thin, abs(x) + thin]  # of the board's top, which the bow must cover
        reach = float(np.interp(ends, -points[:, 0], points[:, 1]).min())
        height = reach * float(up[1])
        bars.append(
            box(
                (x - thin, low, z - 0.03), (x + thin, low + height, z + 0.03), (0.0, -lean * height)
            )
        )
    return [*parts, buried(boxes(bars))]


def arms(rng: Generator, depth: float, high: float, lean: float, rise: float) -> list[Part]:
    """Arm rests from the back to posts near the front."""
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
        shapes.append(
            box(
                (s * x - 0.6 * wide, high - 0.04, start + 0.02),
                (s * x + 0.6 * wide, y - 0.04, front - 0.03),
            )
        )
    return [boxes(shapes)]
