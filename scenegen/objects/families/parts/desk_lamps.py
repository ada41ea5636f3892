"""Lamps whose head hangs at the end of an arm, towards +z."""

import itertools
import math

import numpy as np

from scenegen.objects.families.parts.draws import chance, pick, span
from scenegen.objects.families.parts.moves import buried, moved, turn_about_x
from scenegen.objects.families.parts.profiles import Curve, arc, bezier, line, polyline, tightest
from scenegen.objects.families.parts.surfaces import Part, loft
from scenegen.objects.families.parts.sweeps import tube
from scenegen.objects.families.parts.walls import ring

Generator = np.random.Generator


def _head(rng: Generator, room: float) -> tuple[Curve, float]:
    """A desk lamp's head, that opens downwards from the height returned, smaller than `room`."""
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
    """A head whose top is at (z, y), turned so that it opens down and forward."""
    wall, rise = _head(rng, 0.8 * at[1])
    crown = float(wall[0][-1, 0])
    turn = turn_about_x(-tilt)
    # The top of the head, (0, rise, 0), goes to the arm's end.
    offset = (0.0, at[1] - rise * math.cos(tilt), at[0] + rise * math.sin(tilt))
    lid = loft(polyline((crown + 0.01, rise - 0.05), (0.8 * crown, rise + 0.08)), segments=24)
    bulb = loft(arc((0.0, 0.45 * rise), 0.6 * crown, -80, 80, 8), segments=16)
    stem = loft(polyline((0.3 * crown, 0.5 * rise), (0.3 * crown, rise)), segments=16)
    parts = [loft(ring(wall, 0.025), closed=True, segments=32), lid, buried(bulb), buried(stem)]
    return [moved(part, offset, turn) for part in parts]


def desk(rng: Generator) -> list[Part]:
    """Two straight arms with joints on a weighted foot."""
    plate, thick = span(rng, 0.38, 0.65), span(rng, 0.06, 0.16)
    lower, upper = span(rng, 0.7, 1.5), span(rng, 0.6, 1.3)
    back, ahead = math.radians(span(rng, 5, 40)), math.radians(span(rng, 25, 75))
    thin = span(rng, 0.03, 0.05)
    foot = (-0.4 * plate, thick)
    elbow = (foot[0] - lower * math.sin(back), foot[1] + lower * math.cos(back))
    wrist = (elbow[0] + upper * math.sin(ahead), elbow[1] + upper * math.cos(ahead))
    corner = pick(rng, (1.0, 1.0, 0.15))
    parts = [loft(polyline((plate, 0.0), (0.94 * plate, thick)), corner=corner)]
    arms = [(foot[0], 0.7 * thick), elbow, wrist]
    double = chance(rng, 0.4)
    for start, end in itertools.pairwise(arms):
        for x in (-0.07, 0.07) if double else (0.0,):
            way = line((start[0], start[1]), (end[0], end[1]))
            arm = tube(way, thin, origin=(x, 0.0, 0.0), across=(0.0, 0.0, 1.0))
            parts.append(buried(arm))  # its ends are in the foot and the knobs
    knob = 1.8 * thin + (0.07 if double else 0.0)
    for z, y in (elbow, wrist):
        parts.append(loft(arc((0.0, y), knob, -90, 90, 6), at=(0.0, z), segments=16))
    return parts + _hang(rng, wrist, math.radians(span(rng, 0, 50)))


def bent(rng: Generator) -> list[Part]:
    """One bent tube, from a desk lamp's neck to an arch over a room."""
    plate, thick = span(rng, 0.4, 0.7), span(rng, 0.06, 0.2)
    height, reach = span(rng, 1.4, 3.8), span(rng, 0.7, 1.8)
    thin = span(rng, 0.035, 0.06)
    start = (0.0, 0.7 * thick)
    end = (reach, height * span(rng, 0.62, 0.92))
    path = bezier(
        start,
        (span(rng, -0.5, 0.1), height * 1.15),
        (reach * span(rng, 0.6, 1.0), height * 1.2),
        end,
        16,
    )
    thin = min(thin, 0.7 * tightest(path))
    along = path[1][-1] / math.hypot(*path[1][-1])
    tilt = math.atan2(float(along[0]), -float(along[1])) * span(rng, 0.0, 1.0)
    foot = loft(polyline((plate, 0.0), (0.94 * plate, thick)))
    arm = tube(path, thin, across=(0.0, 0.0, 1.0))
    joint = loft(arc((0.0, end[1]), 1.8 * thin, -90, 90, 8), at=(0.0, end[0]), segments=16)
    return [foot, arm, joint, *_hang(rng, end, tilt)]
