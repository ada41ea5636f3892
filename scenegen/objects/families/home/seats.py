"""Sofas, armchairs and stools, in metres."""

import math

import numpy as np
from numpy.random import Generator

from scenegen.objects.families.parts.draws import chance, pick, span
from scenegen.objects.families.parts.moves import moved, turn_about_x
from scenegen.objects.families.parts.profiles import line
from scenegen.objects.families.parts.soft import bevelled, four, pad, posts
from scenegen.objects.families.parts.surfaces import Part, loft, made_of


def sofa(rng: Generator) -> list[Part]:
    """Build a sofa of two or three seats."""
    return _upholstered(rng, pick(rng, (2, 2, 3)), span(rng, 0.58, 0.72))


def armchair(rng: Generator) -> list[Part]:
    """Build an upholstered armchair."""
    return _upholstered(rng, 1, span(rng, 0.55, 0.66))


def _upholstered(rng: Generator, seats: int, wide: float) -> list[Part]:
    """Build a base, arms, a back and loose cushions, on feet."""
    deep, seat = span(rng, 0.82, 0.95), span(rng, 0.4, 0.46)
    arm, arm_high = span(rng, 0.1, 0.24), span(rng, 0.56, 0.66)
    back, back_high = span(rng, 0.14, 0.2), span(rng, 0.74, 0.9)
    foot = span(rng, 0.04, 0.16)
    edge = span(rng, 0.015, 0.05)
    thick = span(rng, 0.13, 0.18)
    inner = seats * wide / 2
    x, z = inner + arm, deep / 2
    parts = [pad((-inner - 0.02, foot, -z + 0.02), (inner + 0.02, seat - thick, z - 0.02), 0.015)]
    for s in (1.0, -1.0):
        left, right = sorted((s * inner, s * x))
        parts.append(pad((left, foot, -z), (right, arm_high, z), edge, 0.3 * edge, corner=edge))
    lean = -span(rng, 0.0, 0.08)
    shift = (0.0, lean)
    low, high = (-inner, foot + 0.02, -z + 0.01), (inner, back_high, -z + back)
    if chance(rng, 0.5):  # the back runs behind the arms
        low, high = (-x, foot, -z - 0.04), (x, back_high, -z + back - 0.04)
    parts.append(pad(low, high, edge, 0.3 * edge, corner=edge, lift=shift))
    front = z + span(rng, 0.0, 0.03)
    for i in range(seats):
        left = -inner + i * wide
        low, high = (left + 0.004, seat - thick, -z + back), (left + wide - 0.004, seat, front)
        parts.append(pad(low, high, 0.045, span(rng, 0.0, 0.02)))
    tall = back_high - seat + span(rng, -0.06, 0.05)
    for i in range(seats):
        left = -inner + i * wide
        body = pad((left + 0.008, 0.0, -0.075), (left + wide - 0.008, tall, 0.075), 0.05, 0.03)
        tilt = turn_about_x(-math.radians(span(rng, 8, 14)))
        parts.append(moved(body, (0.0, seat - 0.005, -z + back + 0.09), tilt))
    a, b = x - 0.07, z - 0.08
    style = pick(rng, ("tapered", "block", "metal"))
    at = four(a, b)
    if style == "block":
        feet = bevelled(posts(at, 0.03, 0.0, foot + 0.02))
    else:
        thin = 0.012 if style == "metal" else 0.024
        feet = loft(line((0.6 * thin, 0.0), (thin, foot + 0.02)), at=at, segments=16)
    return made_of("cover", *parts) + made_of("feet", feet)


def stool(rng: Generator) -> list[Part]:
    """Build a stool with a round or square seat, a bar stool, a pouf or a block."""
    high, r = pick(rng, (span(rng, 0.42, 0.48), span(rng, 0.6, 0.7))), span(rng, 0.15, 0.19)
    style = pick(rng, ("round", "round", "square", "pouf"))
    if style == "pouf":
        r, high = span(rng, 0.2, 0.28), span(rng, 0.36, 0.44)
        return made_of(
            "cover", pad((-r, 0.0, -r), (r, high, r), 0.05, 0.02, corner=pick(rng, (r, 0.06)))
        )
    thick = span(rng, 0.025, 0.05)
    corner = 0.03 if style == "square" else r
    seat = pad((-r, high - thick, -r), (r, high, r), 0.008, corner=corner)
    parts = made_of("seat", seat)
    if chance(rng, 0.35):
        parts += made_of(
            "cover", pad((-r, high - 0.004, -r), (r, high + 0.045, r), 0.02, 0.008, corner=corner)
        )
    count, thin = pick(rng, (3, 4, 4)) if style == "round" else 4, span(rng, 0.012, 0.02)
    out = span(rng, 0.9, 1.25)
    angles = [2 * math.pi * (i + 0.5) / count for i in range(count)]
    reach = 0.75 * r if style == "round" else 1.15 * r
    feet = [(out * reach * math.cos(a), out * reach * math.sin(a)) for a in angles]
    heads = [(reach * math.cos(a) * 0.9, reach * math.sin(a) * 0.9) for a in angles]
    lean = np.subtract(heads, feet) / (high - thick)
    parts += made_of(
        "legs",
        loft(line((0.7 * thin, 0.0), (thin, high - 0.6 * thick)), at=feet, lean=lean, segments=16),
    )
    if high > 0.55 or chance(rng, 0.3):  # a ring or rails for the feet
        y = 0.35 * high
        ring = reach * (out + (0.9 - out) * y / high)
        corners = [(ring * math.cos(a), y, ring * math.sin(a)) for a in angles]
        parts += made_of("legs", *_rails(corners, 0.6 * thin))
    return parts


def _rails(corners: list[tuple[float, float, float]], thin: float) -> list[Part]:
    """Build straight bars from corner to corner, all at the same height."""
    bars = []
    for i, (x, y, z) in enumerate(corners):
        to_x, _, to_z = corners[(i + 1) % len(corners)]
        length = math.hypot(to_x - x, to_z - z)
        slope = ((to_x - x) / length, 0.0, (to_z - z) / length)
        turn = np.array([[slope[0], 0.0, -slope[2]], [0.0, 1.0, 0.0], [slope[2], 0.0, slope[0]]])
        bar = bevelled([((0.0, -thin, -thin), (length, thin, thin))], 0.4 * thin)
        bars.append(moved(bar, (x, y, z), turn))
    return bars
