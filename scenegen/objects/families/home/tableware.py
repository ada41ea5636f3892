"""Plates, cups, vases and baskets, in metres."""

import math

import numpy as np
from numpy.random import Generator

from scenegen.objects.families.parts.draws import chance, pick, span
from scenegen.objects.families.parts.moves import moved
from scenegen.objects.families.parts.profiles import Curve, arc, bezier, join, line
from scenegen.objects.families.parts.soft import blades
from scenegen.objects.families.parts.surfaces import Part, loft, made_of
from scenegen.objects.families.parts.sweeps import tube
from scenegen.objects.families.parts.walls import hollow


def plate(rng: Generator) -> list[Part]:
    """Build a plate, or a small pile of them."""
    r, high = span(rng, 0.09, 0.145), span(rng, 0.014, 0.03)
    foot = r * span(rng, 0.5, 0.65)
    style = pick(rng, ("rim", "coupe"))
    if style == "rim":
        well = r * span(rng, 0.68, 0.76)
        wall = join(
            line((foot, 0.0), (foot + 0.002, 0.003)),
            bezier(
                (foot + 0.002, 0.003),
                (well, 0.004),
                (well, 0.7 * high),
                (well + 0.01, 0.72 * high),
                6,
            ),
            line((well + 0.01, 0.72 * high), (r, high), strips=2),
        )
    else:
        wall = bezier((foot, 0.0), (0.8 * r, 0.002), (0.97 * r, 0.4 * high), (r, high), 10)
    one = loft(hollow(wall, 0.0035), segments=32)
    count = 1 if chance(rng, 0.7) else 2 + int(2 * rng.random())
    return [moved(one, (0.0, i * 0.0065, 0.0)) for i in range(count)]


def cup(rng: Generator) -> list[Part]:
    """Build a cup, often with a handle (towards +x) and a saucer."""
    r, high = span(rng, 0.036, 0.05), span(rng, 0.055, 0.085)
    foot = r * span(rng, 0.45, 0.8)
    bend = (r * span(rng, 0.9, 1.15), span(rng, 0.0, 0.3) * high)
    wall = bezier((foot, 0.0), bend, (r * span(rng, 0.95, 1.08), 0.6 * high), (r, high), 10)
    level, parts = 0.0, []
    if chance(rng, 0.6):
        s, lip = r * span(rng, 1.6, 1.9), span(rng, 0.012, 0.018)
        dish = bezier((0.55 * s, 0.0), (0.8 * s, 0.001), (0.9 * s, 0.5 * lip), (s, lip), 8)
        parts, level = [loft(hollow(dish, 0.0032))], 0.0034
    body = [loft(hollow(wall, 0.0028))]
    if chance(rng, 0.75):
        body.append(_ear(rng, wall, high))
    coffee = 0.8 * high
    fill = float(np.interp(coffee, wall[0][:, 1], wall[0][:, 0])) - 0.002
    if chance(rng, 0.4):
        body += made_of(
            "drink", loft(line((fill - 0.001, coffee - 0.002), (fill, coffee)), segments=40)
        )
    return parts + [moved(part, (0.0, level, 0.0)) for part in body]


def _ear(rng: Generator, wall: Curve, high: float) -> Part:
    top, low = 0.82 * high, span(rng, 0.22, 0.4) * high
    at_top, at_low = (
        float(np.interp(y, wall[0][:, 1], wall[0][:, 0])) - 0.0015 for y in (top, low)
    )
    pull = span(rng, 0.022, 0.032)
    path = bezier(
        (at_top, top), (at_top + pull, top + 0.004), (at_top + pull, low), (at_low, low), 12
    )
    return tube(path, 0.0038, 0.0026, corner=0.0024, segments=12)


def vase(rng: Generator) -> list[Part]:
    """Build a vase, sometimes with dry stems or a few leaves."""
    high = math.exp(span(rng, math.log(0.14), math.log(0.36)))
    belly, foot = high * span(rng, 0.2, 0.42), high * span(rng, 0.14, 0.24)
    neck = max(0.014, belly * span(rng, 0.25, 0.75))
    at = span(rng, 0.25, 0.7)
    style = pick(rng, ("round", "round", "bottle", "cylinder"))
    if style == "cylinder":
        wall = join(
            arc((foot - 0.008, 0.008), 0.008, -90, 0, 4),
            line((foot, 0.008), (foot * span(rng, 0.9, 1.3), high), strips=3),
        )
        neck = foot
    else:
        rise = max(0.5 if style == "bottle" else span(rng, 0.75, 0.95), 0.8 * at + 0.1)
        wall = join(
            bezier(
                (foot, 0.0),
                (belly, 0.1 * at * high),
                (belly, 0.5 * at * high),
                (belly, at * high * 0.8),
                8,
            ),
            bezier(
                (belly, at * high * 0.8),
                (belly, rise * high),
                (neck, rise * high),
                (neck, high - 0.006),
                12,
            ),
            bezier(
                (neck, high - 0.006),
                (neck, high - 0.003),
                (neck + 0.002, high - 0.002),
                (neck + 0.004, high),
                3,
            ),
        )
    parts = [loft(hollow(wall, 0.004))]
    if chance(rng, 0.45):
        parts += _stems(rng, high, 0.55 * neck)
    return parts


def _stems(rng: Generator, high: float, room: float) -> list[Part]:
    """Build stems that lean out of a vase, with leaves along them."""
    count = 3 + int(5 * rng.random())
    parts, paths, across, widths = [], [], [], []
    leafy = chance(rng, 0.6)
    size = span(rng, 0.02, 0.035)
    for i in range(count):
        angle = 2 * math.pi * (i + span(rng, 0.0, 0.7)) / count
        c, s = math.cos(angle), math.sin(angle)
        reach, top = high * span(rng, 0.15, 0.5), high * span(rng, 1.5, 2.2)
        path = bezier(
            (-0.3 * room, 0.2 * high),
            (0.2 * room, 0.8 * high),
            (0.5 * room, high),
            (room + reach, top),
            8,
        )
        parts += made_of("stem", tube(path, 0.0012, across=(c, 0.0, s), segments=4))
        if not leafy:
            tip = path[0][-1]
            head = loft(arc((0.0, 0.0), (0.009, 0.03), -80, 90, 8), segments=12)
            parts += made_of(
                "stem", moved(head, (c * float(tip[0]), float(tip[1]) + 0.02, s * float(tip[0])))
            )
            continue
        for k in range(5, 9):
            u, y = (float(v) for v in path[0][k])
            for way in (1.0, -1.0):
                turn = angle + way * span(rng, 0.7, 1.4)
                d = np.array([math.cos(turn), span(rng, 0.2, 0.8), math.sin(turn)])
                paths.append(
                    np.array([c * u, y, s * u]) + np.linspace(0, 1, 6)[:, None] * d * size * 1.6
                )
                across.append(np.tile([-math.sin(turn), 0.0, math.cos(turn)], (6, 1)))
                widths.append(size * 0.5 * np.sin(np.pi * np.linspace(0, 1, 6) ** 0.8))
    if paths:
        parts += made_of("leaf", blades(np.array(paths), np.array(across), np.array(widths)))
    return parts


def basket(rng: Generator) -> list[Part]:
    """Build a round or rounded basket, sometimes with two handles."""
    r, high = span(rng, 0.14, 0.22), span(rng, 0.2, 0.38)
    foot = r * span(rng, 0.75, 0.95)
    bulge = r * span(rng, 1.0, 1.2)
    wall = bezier((foot, 0.0), (bulge, 0.25 * high), (bulge, 0.7 * high), (r, high), 10)
    deep = pick(rng, (1.0, 1.0, span(rng, 0.7, 0.85)))
    parts = [loft(hollow(wall, 0.008), size=(1.0, deep), corner=0.6 * deep if deep < 1 else 1.0)]
    if chance(rng, 0.5):
        path = bezier(
            (0.06, high - 0.03), (0.07, high + 0.07), (-0.07, high + 0.07), (-0.06, high - 0.03), 12
        )
        parts += [
            tube(path, 0.008, origin=(0.0, 0.0, s * (deep * r - 0.006)), segments=12)
            for s in (1, -1)
        ]
    return parts
