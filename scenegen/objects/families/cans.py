"""Cans for drinks, food and fish; `tins` holds the others."""

import math

import numpy as np

from scenegen.objects.families.parts import tins
from scenegen.objects.families.parts.boxes import box, boxes
from scenegen.objects.families.parts.draws import chance, pick, span
from scenegen.objects.families.parts.moves import buried, moved, turn_about_z
from scenegen.objects.families.parts.profiles import arc, bezier, fillet, join, line, polyline, wave
from scenegen.objects.families.parts.surfaces import Part, loft
from scenegen.objects.families.parts.sweeps import tube
from scenegen.objects.families.parts.tins import seamed_lid

Generator = np.random.Generator


def can(rng: Generator) -> list[Part]:
    """A can: for drinks, food, fish, oil, spray or paint, a churn, or a crushed one."""
    kinds = (
        _drink,
        _drink,
        _food,
        _food,
        _fish,
        tins.oil,
        tins.spray,
        tins.paint,
        tins.churn,
        _crushed,
    )
    return pick(rng, kinds)(rng)


def _drink(rng: Generator) -> list[Part]:
    height = math.exp(span(rng, math.log(1.8), math.log(5.2)))
    foot, neck = span(rng, 0.6, 0.95), span(rng, 0.5, 0.95)
    low, high = span(rng, 0.08, 0.4), span(rng, 0.12, 0.4) * min(height, 3.0)
    waist = pick(rng, (1.0, 1.0, span(rng, 0.75, 1.2)))
    side = join(
        bezier((foot, 0.0), (foot + 0.03, 0.5 * low), (1.0, 0.6 * low), (1.0, low), 5),
        bezier(
            (1.0, low),
            (waist, 0.6 * low + 0.4 * height),
            (waist, height - high),
            (1.0, height - high),
            8,
        )
        if waist != 1.0
        else line((1.0, low), (1.0, height - high)),
        bezier(
            (1.0, height - high),
            (1.0, height - 0.5 * high),
            (neck, height - 0.7 * high),
            (neck, height),
            6,
        ),
    )
    if neck < 0.7:  # a bottle of tin, with a screw cap
        wide, rise = neck * span(rng, 0.6, 1.05), span(rng, 0.1, 0.6)
        cap = polyline((wide, height), (wide * 1.02, height + rise), (0.0, height + rise))
        return [loft(join(side, line((neck, height), (wide, height)), cap))]
    parts = [loft(join(side, seamed_lid(neck, height, 0.045)))]
    if chance(rng, 0.6):  # the tab, towards +z
        reach, half = neck * span(rng, 0.35, 0.6), neck * span(rng, 0.16, 0.26)
        flat = box((-half, height - 0.05, -0.15 * neck), (half, height + 0.03, reach))
        parts.append(buried(boxes([flat])))
    if chance(rng, 0.35):  # a straw, straight or bent
        angle, tilt = span(rng, 0.0, 2 * math.pi), span(rng, 0.05, 0.45)
        rise, bend = span(rng, 0.5, 1.4), span(rng, 0.0, 1.0)
        foot_at, kink = (
            (0.1, height - 0.1),
            (0.1 + rise * math.sin(tilt), height + rise * math.cos(tilt)),
        )
        end = (kink[0] + 0.6 * math.sin(tilt + bend), kink[1] + 0.6 * math.cos(tilt + bend))
        across = (math.cos(angle), 0.0, math.sin(angle))
        parts.append(tube(fillet([foot_at, kink, end], 0.15, 4), 0.06, across=across))
    return parts


def _crushed(rng: Generator) -> list[Part]:
    """A drink can pressed together: folds of uneven depth."""
    folds, height = 2 + int(4 * rng.random()), span(rng, 0.9, 2.6)
    steps = [span(rng, 0.6, 1.4) for _ in range(2 * folds + 1)]
    levels = np.cumsum([0.12, *(step * (height - 0.12) / sum(steps) for step in steps)]).tolist()
    radii = [span(rng, 0.84, 0.96) if i % 2 else span(rng, 0.97, 1.06) for i in range(len(levels))]
    corners = list(zip(radii, levels, strict=True))
    neck = 0.75
    side = polyline((0.75, 0.0), *corners, (neck, levels[-1] + 0.15))
    lean = (span(rng, -0.15, 0.15), span(rng, -0.15, 0.15))
    return [loft(join(side, seamed_lid(neck, levels[-1] + 0.15, 0.045)), lean=lean)]


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
    parts = [loft(join(side, seamed_lid(1.0, height, bead)))]
    if chance(rng, 0.5):  # half opened: the lid stands up at one side
        tilt = span(rng, 0.3, 1.5)
        turn = turn_about_z(tilt)
        hinge = (-0.97 + 0.9 * math.cos(tilt), height + 0.9 * math.sin(tilt), 0.0)
        parts.append(moved(loft(polyline((0.9, 0.0), (0.9, 0.05))), hinge, turn))
    return parts


def _fish(rng: Generator) -> list[Part]:
    height = span(rng, 0.25, 1.0)
    bead = span(rng, 0.03, 0.06)
    size, corner = pick(rng, (((1.0, 1.0), 1.0), ((span(rng, 1.1, 2.0), 1.0), span(rng, 0.2, 1.0))))
    slope = span(rng, max(0.7, 1.0 - 0.45 * height), 1.0)
    edge = span(rng, 0.1, 0.3) * height
    side = join(arc((slope - edge, edge), edge, -90, 0, 4), line((slope, edge), (1.0, height)))
    ring = tube(
        arc((0.0, 0.0), (0.2, 0.14), 0, 350, 20),
        0.02,
        origin=(0.0, height + 0.02, span(rng, 0.3, 0.6)),
        across=(1.0, 0.0, 0.0),
        up=(0.0, 0.0, 1.0),
        segments=8,
    )
    parts = [loft(join(side, seamed_lid(1.0, height, bead)), size=size, corner=corner)]
    if chance(rng, 0.4):
        return [*parts, buried(ring)]
    tilt = span(rng, 0.3, 1.6)  # opened
    lid = loft(polyline((0.92, 0.0), (0.92, 0.05)), size=size, corner=corner)
    half = 0.92 * size[0]
    hinge = (-half + half * math.cos(tilt), height + half * math.sin(tilt), 0.0)
    return [*parts, moved(lid, hinge, turn_about_z(tilt))]
