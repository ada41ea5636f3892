"""Tins for oil, spray, paint and milk, and the lid that cans share."""

import math

import numpy as np

from scenegen.objects.families.parts.draws import chance, span
from scenegen.objects.families.parts.moves import moved, turn_about_x
from scenegen.objects.families.parts.profiles import (
    Curve,
    arc,
    bezier,
    fillet,
    join,
    line,
    polyline,
)
from scenegen.objects.families.parts.surfaces import Part, loft
from scenegen.objects.families.parts.sweeps import tube

Generator = np.random.Generator


def seamed_lid(radius: float, height: float, bead: float) -> Curve:
    """A bead at the edge, and a lid sunk below it."""
    sunk = height - 1.2 * bead
    inner = radius - bead
    return join(
        arc((radius, height + bead), bead, -90, 90, 8),
        polyline(
            (radius, height + 2 * bead), (inner, height + 2 * bead), (inner, sunk), (0.0, sunk)
        ),
    )


def oil(rng: Generator) -> list[Part]:
    """A square tin with a spout and a handle at times."""
    height = math.exp(span(rng, math.log(1.2), math.log(3.6)))
    depth, corner = span(rng, 0.45, 1.0), span(rng, 0.06, 0.3)
    rim = 0.05
    corners = [(1.0 + rim, 0.0), (1.0 + rim, 0.1), (1.0, 0.1), (1.0, height - 0.1)]
    corners += [(1.0 + rim, height - 0.1), (1.0 + rim, height)]
    parts = [loft(polyline(*corners), size=(1.0, depth), corner=corner, segments=24)]
    if chance(rng, 0.6):
        spout, rise = span(rng, 0.12, 0.3) * depth + 0.05, span(rng, 0.1, 0.4)
        x = span(rng, 0.0, 0.6)
        profile = polyline((spout, height - 0.02), (0.9 * spout, height + rise))
        parts.append(loft(profile, at=(x, 0.0), segments=24))
    if chance(rng, 0.6):
        rise, half = span(rng, 0.15, 0.35), span(rng, 0.3, 0.5)
        ends = [(-half, height - 0.03), (-half, height + rise), (half, height + rise)]
        path = fillet([*ends, (half, height - 0.03)], 0.12, 5)
        parts.append(tube(path, 0.09, 0.03, across=(-1.0, 0.0, 0.0), origin=(-0.3, 0.0, 0.0)))
    return parts


def spray(rng: Generator) -> list[Part]:
    """A tall can with a dome, under a cap or with its nozzle bare."""
    height = math.exp(span(rng, math.log(2.0), math.log(6.0)))
    bead, dome = 0.05, span(rng, 0.15, 1.0)
    top = span(rng, 0.35, 0.75)
    side = join(
        arc((1.0, bead), bead, -90, 90, 8),
        line((1.0, 2 * bead), (1.0, height)),
        arc((1.0, height + bead), bead, -90, 90, 8),
        bezier(
            (1.0, height + 2 * bead),
            (1.0, height + 2 * bead + 0.6 * dome),
            (top, height + 0.8 * dome),
            (top, height + 2 * bead + dome),
            6,
        ),
    )
    high = height + 2 * bead + dome
    if chance(rng, 0.5):  # a cap over everything
        wide, rise = span(rng, 0.72, 1.04), span(rng, 0.3, 1.6)
        edge = span(rng, 0.05, 0.5) * wide * min(rise, 1.0)
        cap = join(
            line((wide, height + bead), (wide, high + rise - edge)),
            arc((wide - edge, high + rise - edge), edge, 0, 90, 5),
        )
        return [loft(side), loft(cap)]
    nozzle = span(rng, 0.15, 0.34)
    return [
        loft(join(side, polyline((top, high), (top, high + 0.1)))),
        loft(polyline((nozzle, high), (0.85 * nozzle, high + span(rng, 0.25, 0.9)))),
    ]


def paint(rng: Generator) -> list[Part]:
    """A bucket with a lid, and a bail that leans to one side."""
    height = math.exp(span(rng, math.log(1.1), math.log(3.4)))
    bead = 0.06
    foot = span(rng, 0.7, 1.0)
    side = join(line((foot, 0.0), (1.0, height)), seamed_lid(1.0, height, bead))
    parts = [loft(side)]
    if chance(rng, 0.75):
        # The bail stands up from two ears.
        high = height * span(rng, 0.75, 0.92)
        rise = height + span(rng, 0.3, 1.1) - high
        path = arc((0.0, high), (1.06, rise), 0, 180, 16)
        turn = turn_about_x(span(rng, -1.0, 1.0))  # it leans to one side
        bail = moved(tube(path, 0.05, segments=8, thin=True), (0.0, -high, 0.0))
        parts.append(moved(moved(bail, (0.0, 0.0, 0.0), turn), (0.0, high, 0.0)))
        ears = polyline((0.1, high - 0.12), (0.1, high + 0.12))
        parts.append(loft(ears, at=[(1.02, 0.0), (-1.02, 0.0)], segments=16))
    return parts


def churn(rng: Generator) -> list[Part]:
    """A milk can with a narrow neck, and two handles at times."""
    height = math.exp(span(rng, math.log(1.0), math.log(3.8)))
    neck, rise = span(rng, 0.35, 0.85), span(rng, 0.25, 1.1)
    foot = span(rng, 0.75, 1.1)
    high = height + rise
    lip, lid = neck + span(rng, 0.05, 0.25), span(rng, 0.15, 0.5)
    side = join(
        line((foot, 0.0), (1.0, height)),
        bezier(
            (1.0, height),
            (1.0, height + span(rng, 0.2, 0.8) * rise),
            (neck, height + span(rng, 0.2, 0.7) * rise),
            (neck, high),
            12,
        ),
        polyline((neck, high), (lip, high + 0.7 * lid), (lip, high + lid), (0.0, high + lid + 0.1)),
    )
    parts = [loft(side)]
    if chance(rng, 0.7):
        low, far = height - 0.15, span(rng, 1.25, 1.7)
        path = bezier((0.9, low), (far, low), (far, high + 0.1), (neck * 0.9, high + 0.1), 12)
        parts += [tube(path, 0.07, across=(way, 0.0, 0.0)) for way in (1.0, -1.0)]
    return parts
