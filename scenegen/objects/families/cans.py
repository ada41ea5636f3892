"""Cans: for drinks, food, fish, oil, spray, paint and milk, and crushed ones."""

import math

import numpy as np
from numpy.random import Generator

from scenegen.objects.families.parts.boxes import box, boxes
from scenegen.objects.families.parts.draws import chance, pick, span
from scenegen.objects.families.parts.moves import buried, moved, turn_about_x, turn_about_z
from scenegen.objects.families.parts.profiles import Curve, arc, bezier, fillet, join, line, wave
from scenegen.objects.families.parts.surfaces import Part, loft
from scenegen.objects.families.parts.sweeps import tube


def can(rng: Generator) -> list[Part]:
    """Build a can of a random kind."""
    kinds = (_drink, _drink, _food, _food, _fish, _oil, _spray, _paint, _churn, _crushed)
    return pick(rng, kinds)(rng)


def _drink(rng: Generator) -> list[Part]:
    height = math.exp(span(rng, math.log(1.8), math.log(5.2)))
    foot, neck = span(rng, 0.6, 0.95), span(rng, 0.5, 0.95)
    low, high = span(rng, 0.08, 0.4), span(rng, 0.12, 0.4) * min(height, 3.0)
    waist = pick(rng, (1.0, 1.0, span(rng, 0.75, 1.2)))
    base = bezier((foot, 0.0), (foot + 0.03, 0.5 * low), (1.0, 0.6 * low), (1.0, low), 5)
    upper = height - high
    middle = line((1.0, low), (1.0, upper))
    if waist != 1.0:
        waist_low = (waist, 0.6 * low + 0.4 * height)
        middle = bezier((1.0, low), waist_low, (waist, upper), (1.0, upper), 8)
    shoulder, throat = (1.0, height - 0.5 * high), (neck, height - 0.7 * high)
    side = join(base, middle, bezier((1.0, upper), shoulder, throat, (neck, height), 6))
    if neck < 0.7:  # a metal bottle with a screw cap
        wide, rise = neck * span(rng, 0.6, 1.05), span(rng, 0.1, 0.6)
        cap = line((wide, height), (wide * 1.02, height + rise), (0.0, height + rise))
        return [loft(join(side, line((neck, height), (wide, height)), cap))]
    parts = [loft(join(side, _seamed_lid(neck, height, 0.045)))]
    if chance(rng, 0.6):  # the tab, towards +z
        reach, half = neck * span(rng, 0.35, 0.6), neck * span(rng, 0.16, 0.26)
        flat = box((-half, height - 0.05, -0.15 * neck), (half, height + 0.03, reach))
        parts.append(buried(boxes([flat])))
    if chance(rng, 0.35):  # a straw, straight or bent
        angle, tilt = span(rng, 0.0, 2 * math.pi), span(rng, 0.05, 0.45)
        rise, bend = span(rng, 0.5, 1.4), span(rng, 0.0, 1.0)
        kink = (0.1 + rise * math.sin(tilt), height + rise * math.cos(tilt))
        end = (kink[0] + 0.6 * math.sin(tilt + bend), kink[1] + 0.6 * math.cos(tilt + bend))
        across = (math.cos(angle), 0.0, math.sin(angle))
        parts.append(tube(fillet([(0.1, height - 0.1), kink, end], 0.15, 4), 0.06, across=across))
    return parts


def _crushed(rng: Generator) -> list[Part]:
    """Build a crushed drink can, with folds of uneven depth."""
    folds, height = 2 + int(4 * rng.random()), span(rng, 0.9, 2.6)
    steps = [span(rng, 0.6, 1.4) for _ in range(2 * folds + 1)]
    levels = np.cumsum([0.12, *(step * (height - 0.12) / sum(steps) for step in steps)]).tolist()
    radii = [span(rng, 0.84, 0.96) if i % 2 else span(rng, 0.97, 1.06) for i in range(len(levels))]
    corners = list(zip(radii, levels, strict=True))
    neck = 0.75
    side = line((0.75, 0.0), *corners, (neck, levels[-1] + 0.15))
    lean = (span(rng, -0.15, 0.15), span(rng, -0.15, 0.15))
    return [loft(join(side, _seamed_lid(neck, levels[-1] + 0.15, 0.045)), lean=lean)]


def _food(rng: Generator) -> list[Part]:
    height = math.exp(span(rng, math.log(0.8), math.log(4.0)))
    bead = span(rng, 0.03, 0.08)
    first = height * span(rng, 0.08, 0.45)
    last = height - height * span(rng, 0.08, 0.4)
    count = 1 + int(5 * rng.random())
    depth = min(span(rng, 0.03, 0.12), 0.12 * (last - first) / count)
    plain = chance(rng, 0.2)
    middle = (
        line((1.0, first), (1.0, last)) if plain else wave((1.0, first), (1.0, last), depth, count)
    )
    side = join(
        arc((1.0, bead), bead, -90, 90, 8),
        line((1.0, 2 * bead), (1.0, first)),
        middle,
        line((1.0, last), (1.0, height)),
    )
    parts = [loft(join(side, _seamed_lid(1.0, height, bead)))]
    if chance(rng, 0.5):  # half open: the lid stands up at one side
        tilt = span(rng, 0.3, 1.5)
        turn = turn_about_z(tilt)
        hinge = (-0.97 + 0.9 * math.cos(tilt), height + 0.9 * math.sin(tilt), 0.0)
        parts.append(moved(loft(line((0.9, 0.0), (0.9, 0.05))), hinge, turn))
    return parts


def _fish(rng: Generator) -> list[Part]:
    height = span(rng, 0.25, 1.0)
    bead = span(rng, 0.03, 0.06)
    size, corner = pick(rng, (((1.0, 1.0), 1.0), ((span(rng, 1.1, 2.0), 1.0), span(rng, 0.2, 1.0))))
    slope = span(rng, max(0.7, 1.0 - 0.45 * height), 1.0)
    edge = span(rng, 0.1, 0.3) * height
    side = join(arc((slope - edge, edge), edge, -90, 0, 4), line((slope, edge), (1.0, height)))
    loop = arc((0.0, 0.0), (0.2, 0.14), 0, 350, 20)
    place = (0.0, height + 0.02, span(rng, 0.3, 0.6))
    ring = tube(loop, 0.02, origin=place, up=(0.0, 0.0, 1.0), segments=8)
    parts = [loft(join(side, _seamed_lid(1.0, height, bead)), size=size, corner=corner)]
    if chance(rng, 0.4):
        return [*parts, buried(ring)]
    tilt = span(rng, 0.3, 1.6)  # the lid's angle when it is open
    lid = loft(line((0.92, 0.0), (0.92, 0.05)), size=size, corner=corner)
    half = 0.92 * size[0]
    hinge = (-half + half * math.cos(tilt), height + half * math.sin(tilt), 0.0)
    return [*parts, moved(lid, hinge, turn_about_z(tilt))]


def _seamed_lid(radius: float, height: float, bead: float) -> Curve:
    """Return the profile of a can's top: a bead at the edge and a lid sunk below it."""
    sunk = height - 1.2 * bead
    inner, top = radius - bead, height + 2 * bead
    lid = line((radius, top), (inner, top), (inner, sunk), (0.0, sunk))
    return join(arc((radius, height + bead), bead, -90, 90, 8), lid)


def _oil(rng: Generator) -> list[Part]:
    """Build a square oil can, sometimes with a spout or a handle."""
    height = math.exp(span(rng, math.log(1.2), math.log(3.6)))
    depth, corner = span(rng, 0.45, 1.0), span(rng, 0.06, 0.3)
    rim = 0.05
    corners = [(1.0 + rim, 0.0), (1.0 + rim, 0.1), (1.0, 0.1), (1.0, height - 0.1)]
    corners += [(1.0 + rim, height - 0.1), (1.0 + rim, height)]
    parts = [loft(line(*corners), size=(1.0, depth), corner=corner, segments=24)]
    if chance(rng, 0.6):
        spout, rise = span(rng, 0.12, 0.3) * depth + 0.05, span(rng, 0.1, 0.4)
        x = span(rng, 0.0, 0.6)
        profile = line((spout, height - 0.02), (0.9 * spout, height + rise))
        parts.append(loft(profile, at=(x, 0.0), segments=24))
    if chance(rng, 0.6):
        rise, half = span(rng, 0.15, 0.35), span(rng, 0.3, 0.5)
        ends = [(-half, height - 0.03), (-half, height + rise), (half, height + rise)]
        path = fillet([*ends, (half, height - 0.03)], 0.12, 5)
        parts.append(tube(path, 0.09, 0.03, across=(-1.0, 0.0, 0.0), origin=(-0.3, 0.0, 0.0)))
    return parts


def _spray(rng: Generator) -> list[Part]:
    """Build a spray can: a tall body with a dome, and a cap or a bare nozzle on top."""
    height = math.exp(span(rng, math.log(2.0), math.log(6.0)))
    bead, dome = 0.05, span(rng, 0.15, 1.0)
    top = span(rng, 0.35, 0.75)
    low = height + 2 * bead
    high = low + dome
    side = join(
        arc((1.0, bead), bead, -90, 90, 8),
        line((1.0, 2 * bead), (1.0, height)),
        arc((1.0, height + bead), bead, -90, 90, 8),
        bezier((1.0, low), (1.0, low + 0.6 * dome), (top, height + 0.8 * dome), (top, high), 6),
    )
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
        loft(join(side, line((top, high), (top, high + 0.1)))),
        loft(line((nozzle, high), (0.85 * nozzle, high + span(rng, 0.25, 0.9)))),
    ]


def _paint(rng: Generator) -> list[Part]:
    """Build a paint can: a bucket with a lid, and often a bail that leans to one side."""
    height = math.exp(span(rng, math.log(1.1), math.log(3.4)))
    bead = 0.06
    foot = span(rng, 0.7, 1.0)
    side = join(line((foot, 0.0), (1.0, height)), _seamed_lid(1.0, height, bead))
    parts = [loft(side)]
    if chance(rng, 0.75):
        # The bail stands up from two ears.
        high = height * span(rng, 0.75, 0.92)
        rise = height + span(rng, 0.3, 1.1) - high
        path = arc((0.0, high), (1.06, rise), 0, 180, 16)
        turn = turn_about_x(span(rng, -1.0, 1.0))
        bail = moved(tube(path, 0.05, segments=8, thin=True), (0.0, -high, 0.0))
        parts.append(moved(moved(bail, (0.0, 0.0, 0.0), turn), (0.0, high, 0.0)))
        ears = line((0.1, high - 0.12), (0.1, high + 0.12))
        parts.append(loft(ears, at=[(1.02, 0.0), (-1.02, 0.0)], segments=16))
    return parts


def _churn(rng: Generator) -> list[Part]:
    """Build a milk churn with a narrow neck, often with two handles."""
    height = math.exp(span(rng, math.log(1.0), math.log(3.8)))
    neck, rise = span(rng, 0.35, 0.85), span(rng, 0.25, 1.1)
    foot = span(rng, 0.75, 1.1)
    high = height + rise
    lip, lid = neck + span(rng, 0.05, 0.25), span(rng, 0.15, 0.5)
    begin = (1.0, height + span(rng, 0.2, 0.8) * rise)
    end = (neck, height + span(rng, 0.2, 0.7) * rise)
    side = join(
        line((foot, 0.0), (1.0, height)),
        bezier((1.0, height), begin, end, (neck, high), 12),
        line((neck, high), (lip, high + 0.7 * lid), (lip, high + lid), (0.0, high + lid + 0.1)),
    )
    parts = [loft(side)]
    if chance(rng, 0.7):
        low, far = height - 0.15, span(rng, 1.25, 1.7)
        path = bezier((0.9, low), (far, low), (far, high + 0.1), (neck * 0.9, high + 0.1), 12)
        parts += [tube(path, 0.07, across=(way, 0.0, 0.0)) for way in (1.0, -1.0)]
    return parts
