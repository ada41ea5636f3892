"""Chairs. The seat's front is +z, the back stands at -z."""

import math

import numpy as np

from scenegen.objects.families.parts.boxes import box, boxes
from scenegen.objects.families.parts.chair_backs import arms, back
from scenegen.objects.families.parts.chair_legs import legs
from scenegen.objects.families.parts.draws import chance, pick, span
from scenegen.objects.families.parts.profiles import arc, join, line, polyline
from scenegen.objects.families.parts.surfaces import Part, loft
from scenegen.objects.families.parts.sweeps import tube

Generator = np.random.Generator
Corners = list[tuple[float, float, float]]
HALF = 1.0  # half the seat's width


def chair(rng: Generator) -> list[Part]:
    """A chair, an armchair or a bar chair: seat, legs, back and perhaps arms."""
    high = math.exp(span(rng, math.log(1.2), math.log(2.9)))  # of the seat
    depth = span(rng, 0.75, 1.15)  # half of it
    thick = span(rng, 0.08, 0.3)
    if chance(rng, 0.15):
        return _tub(rng)
    style = pick(rng, ("square", "square", "round", "soft"))
    seat = _seat(style, depth, high, thick)
    under = high - thick
    shrink = 0.8 if style == "round" else 1.0  # of what must meet the seat within its corners
    parts = legs(rng, shrink, shrink * depth, under)
    rise = span(rng, 1.1, 2.6)
    upright, lean = back(rng, depth, high, rise, 0.95 * shrink)
    parts = [seat, *parts, *upright]
    if style != "round" and chance(rng, 0.4):
        parts += arms(rng, depth, high, lean, rise)
    return parts


def _seat(style: str, depth: float, high: float, thick: float) -> Part:
    low = high - thick
    if style == "square":
        return boxes([box((-HALF, low, -depth), (HALF, high, depth))])
    if style == "round":
        side = polyline((HALF - 0.05, low), (HALF, high))
        return loft(side, base=(0.0, depth - HALF, 0.6 * min(depth, HALF) - HALF))
    edge = 0.49 * thick
    side = join(
        arc((HALF - edge, low + edge), edge, -90, 0, 4),
        line((HALF, low + edge), (HALF, high - edge)),
        arc((HALF - edge, high - edge), edge, 0, 90, 4),
    )
    return loft(side, base=(0.0, depth - HALF, 0.25 - HALF), segments=32)


def _tub(rng: Generator) -> list[Part]:
    """An upholstered tub: arms and back are one bent wall about the seat."""
    high, rise = span(rng, 0.75, 1.2), span(rng, 0.5, 1.3)
    radius, thick = span(rng, 0.9, 1.15), span(rng, 0.12, 0.25)
    foot = span(rng, 0.15, 0.45)
    deep = span(rng, 0.3, 0.9)
    bend = arc((0.0, 0.0), radius, 0, -180, 20)
    path = join(
        (np.array([[radius, deep]]), np.array([[0.0, -1.0]])),
        bend,
        (np.array([[-radius, deep]]), np.array([[0.0, 1.0]])),
    )
    middle = (high + rise + foot) / 2
    wall = tube(
        path,
        (high + rise - foot) / 2,
        thick,
        origin=(0.0, middle, 0.0),
        up=(0.0, 0.0, 1.0),
        corner=0.8 * thick,
    )
    edge = 0.12
    cushion = join(
        line((1.0, foot + 0.05), (1.0, high - edge)), arc((1.0 - edge, high - edge), edge, 0, 90, 4)
    )
    size = radius - 0.02
    half = (radius + deep) / 2
    seat = loft(
        cushion,
        base=(size - 1.0, half - 1.0, 0.3 - 1.0),
        at=(0.0, deep - half + 0.05),
        segments=32,
    )
    x, z = 0.7 * radius, 0.55 * radius
    if chance(rng, 0.3):
        plate = polyline((0.7, 0.0), (0.7, 0.06), (0.12, 0.08), (0.12, foot + 0.1))
        return [wall, seat, loft(plate, segments=32)]
    spots = [(x, 0.7 * deep), (-x, 0.7 * deep), (x, -z), (-x, -z)]
    feet = loft(line((0.06, 0.0), (0.1, foot + 0.15)), at=spots, segments=16)
    return [wall, seat, feet]
