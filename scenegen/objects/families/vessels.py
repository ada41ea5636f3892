"""Bowls and mugs: vessels with thin walls. Handles point to +x."""

import math

import numpy as np
from numpy.random import Generator

from scenegen.objects.families.parts.draws import chance, pick, span
from scenegen.objects.families.parts.profiles import Curve, arc, bezier, fillet, join, limited, line
from scenegen.objects.families.parts.surfaces import Part, loft
from scenegen.objects.families.parts.sweeps import tube
from scenegen.objects.families.parts.walls import hollow


def bowl(rng: Generator) -> list[Part]:
    """Build a round, oval or square bowl, deep or flat, sometimes on a foot or with two handles."""
    outline = pick(rng, ("round", "round", "round", "oval", "square"))
    height = math.exp(span(rng, math.log(0.35), math.log(1.25)))
    bottom = span(rng, 0.25, 0.65)
    thickness = span(rng, 0.03, 0.09) * min(1.0, height + 0.3)
    foot = pick(rng, (0.0, span(rng, 0.04, 0.16), span(rng, 0.04, 0.16), span(rng, 0.2, 0.55)))
    belly = bottom + (1.0 - bottom) * span(rng, 0.35, 1.15)
    flare = span(rng, 0.75, 1.15)
    low = (belly, foot + span(rng, 0.0, 0.25) * height)
    high = (flare, foot + span(rng, 0.35, 0.85) * height)
    wall = bezier((bottom, foot), low, high, (1.0, foot + height), 10)
    profile = hollow(wall, thickness)
    if foot:
        stem = bottom * (span(rng, 0.35, 0.6) if foot > 0.17 else span(rng, 0.75, 0.95))
        spread = bottom * span(rng, 0.95, 1.2)
        under = bezier((spread, 0.0), (stem, foot * 0.15), (stem, foot * 0.5), (bottom, foot), 8)
        profile = join(under, profile)
    size, corner = (1.0, 1.0), 1.0
    if outline == "oval":
        size, corner = (span(rng, 1.2, 1.7), 1.0), 1.0
    elif outline == "square":
        size, corner = (pick(rng, (1.0, span(rng, 1.1, 1.5))), 1.0), span(rng, 0.3, 0.65)
    parts = [loft(profile, size=size, corner=corner)]
    if chance(rng, 0.25):
        # Two horizontal loop handles at the ends, a little below the rim, sunk into the wall.
        reach, half = span(rng, 0.15, 0.3), span(rng, 0.18, 0.32)
        at = int(len(wall[0]) * span(rng, 0.72, 0.9))
        radius, level = (float(v) for v in wall[0][at])
        inner = size[0] * (radius - 0.6 * thickness) - 0.07 * half
        outer = inner + 1.33 * (reach + 0.1)
        hoop = bezier((inner, half), (outer, half * 1.1), (outer, -half * 1.1), (inner, -half), 11)
        bar = min(span(rng, 0.035, 0.06), 0.4 * (height - level + foot) + 0.03)
        origin = (0.0, level, 0.0)
        for way in (1.0, -1.0):
            across, up = (way, 0.0, 0.0), (0.0, 0.0, way)
            parts.append(tube(hoop, bar, origin=origin, across=across, up=up, segments=12))
    return parts


def mug(rng: Generator) -> list[Part]:
    """Build a cup with one handle, from an espresso cup to a tankard."""
    height = math.exp(span(rng, math.log(1.0), math.log(3.0)))
    foot, belly = span(rng, 0.55, 1.0), span(rng, 0.75, 1.2)
    thickness = span(rng, 0.06, 0.12)
    style = pick(rng, ("straight", "curved", "curved", "round"))
    if style == "straight":
        edge = span(rng, 0.04, 0.2)
        wall = join(
            arc((foot - edge, edge), edge, -90, 0, 5), line((foot, edge), (1.0, height), strips=2)
        )
    elif style == "curved":
        upper = (span(rng, 0.8, 1.15), 0.7 * height)
        wall = bezier((foot, 0.0), (belly, 0.3 * height), upper, (1.0, height), 10)
    else:
        lower, upper = (span(rng, 0.9, 1.25), 0.0), (belly, span(rng, 0.4, 0.6) * height)
        wall = bezier((0.6 * foot, 0.0), lower, upper, (1.0, height), 10)
    return [loft(hollow(wall, thickness)), _handle(rng, wall, thickness, height)]


def _handle(rng: Generator, wall: Curve, thickness: float, height: float) -> Part:
    """Build a handle in the plane z = 0 whose ends are sunk into the wall."""
    top, low = span(rng, 0.74, 0.88) * height, span(rng, 0.12, 0.38) * height
    radii = np.interp([top, low], wall[0][:, 1], wall[0][:, 0]) - 0.55 * thickness
    at_top, at_low = float(radii[0]), float(radii[1])
    reach = max(at_top, at_low) + span(rng, 0.35, 0.75) * min(1.0, 0.45 + 0.35 * (top - low))
    half_width, bar = span(rng, 0.08, 0.17), span(rng, 0.05, 0.1)
    style = pick(rng, ("c", "ear", "square"))
    if style == "square":
        room = min((top - low) / 2, reach - max(at_top, at_low))
        corners = [(at_top, top), (reach, top), (reach, low), (at_low, low)]
        path = fillet(corners, max(0.1, span(rng, 0.35, 0.8) * room), 5)
    elif style == "c":
        pull = (reach - (at_top + at_low) / 2) * 4 / 3
        path = bezier((at_top, top), (at_top + pull, top), (at_low + pull, low), (at_low, low), 13)
    else:
        turn = (reach, top - span(rng, 0.25, 0.5) * (top - low))
        shoulder = (at_top + 0.6 * (reach - at_top), top + 0.04 * height)
        path = bezier((at_top, top), shoulder, (reach, top), turn, 7)
        bend = (reach, 0.4 * turn[1] + 0.6 * low)
        tail = bezier(turn, bend, (at_low + 0.3, low), (at_low, low), 7)
        path = join(path, (tail[0][1:], tail[1][1:]))
    bar = limited(path, bar)
    return tube(path, half_width, bar, corner=span(rng, 0.6, 1.0) * min(bar, half_width))
