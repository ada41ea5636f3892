"""Bottles: a body, a shoulder, a neck and a closure."""

import math

from numpy.random import Generator

from scenegen.objects.families.parts.draws import chance, pick, span
from scenegen.objects.families.parts.profiles import Curve, arc, bezier, fillet, join, line, wave
from scenegen.objects.families.parts.surfaces import Part, loft, made_of
from scenegen.objects.families.parts.sweeps import tube

HEIGHT = 3.0  # of every bottle, without its closure


def bottle(rng: Generator) -> list[Part]:
    """Build a bottle with a round, flat or square cross-section."""
    outline = pick(rng, ("round", "round", "round", "flat", "square"))
    radius = math.exp(span(rng, math.log(0.36), math.log(1.0)))
    neck = radius * span(rng, 0.22, 0.6)
    neck_height = HEIGHT * span(rng, 0.06, 0.36)
    shoulder = HEIGHT * span(rng, 0.04, 0.32)
    top = HEIGHT - neck_height
    low = top - shoulder
    body, upper = _body(rng, radius, neck * 1.15, low)
    soft = outline == "round" and chance(rng, 0.6)  # the shoulder blends into the neck
    if soft:
        bend = (neck, low + shoulder * span(rng, 0.3, 0.75))
    else:
        bend = (neck + (upper - neck) * span(rng, 0.2, 0.9), top)
    rise = (upper, low + shoulder * span(rng, 0.15, 0.7))
    body = join(body, bezier((upper, low), rise, bend, (neck, top), 9))
    stem, mouth = _neck(rng, neck, top)
    if outline == "round":
        parts = [loft(join(body, stem), segments=32)]
    else:
        # The cross-section turns round towards the top of the body, where the neck is round.
        most = max(radius, upper, float(body[0][:, 0].max()))
        depth = span(rng, 0.4, 0.75) if outline == "flat" else span(rng, 0.75, 1.0)
        depth = max(depth, 0.4 + 0.6 * neck / most)
        slope = (depth * most - neck) / (most - neck)
        bevel = 1.0 if outline == "flat" else span(rng, 0.15, 0.5)
        round_slope = (bevel * depth * most - neck) / (most - neck)
        base = (0.0, neck * (1 - slope), neck * (1 - round_slope))
        parts = [
            loft(body, size=(1.0, slope), corner=round_slope, base=base, segments=28),
            loft(join(line((neck, top - 0.02), (neck, top)), stem), segments=24),
        ]
    return parts + made_of("closure", *_closure(rng, mouth))


def _body(rng: Generator, radius: float, least: float, high: float) -> tuple[Curve, float]:
    """Return the profile from the base up to `high`, and its radius there (at least `least`)."""
    foot = max(radius * span(rng, 0.8, 1.05), least)
    edge = min(foot * span(rng, 0.05, 0.3), 0.3 * high, foot - 0.9 * least)
    base = arc((foot - edge, edge), edge, -90, 0, 5)
    style = pick(rng, ("straight", "straight", "tapered", "waisted", "bulged", "ribbed"))
    if style == "straight":
        return join(base, line((foot, edge), (foot, high))), foot
    if style == "ribbed":
        first, last = edge + 0.1 * (high - edge), edge + span(rng, 0.6, 0.9) * (high - edge)
        count = 2 + int(3 * rng.random())
        depth = min(0.07 * foot, 0.1 * (last - first) / count)
        groove = wave((foot, first), (foot, last), depth, count)
        ends = line((foot, edge), (foot, first)), line((foot, last), (foot, high))
        return join(base, ends[0], groove, ends[1]), foot
    upper = max(radius * span(rng, 0.7, 1.2), least)
    third = (high - edge) / 3
    if style == "tapered":
        side = bezier((foot, edge), (foot, edge + third), (upper, high - third), (upper, high), 8)
    else:
        bulge = span(rng, 0.55, 0.8) if style == "waisted" else span(rng, 1.15, 1.45)
        middle = max(radius * bulge, least)
        low, end = (middle, edge + third), (middle, high - third)
        side = bezier((foot, edge), low, end, (upper, high), 9)
    return join(base, side), upper


def _neck(rng: Generator, radius: float, low: float) -> tuple[Curve, tuple[float, float]]:
    """Return the profile of neck, lip and opening, and the mouth's (outer radius, height)."""
    narrow = radius * span(rng, 0.8, 1.0)
    lip = radius * span(rng, 0.03, 0.16)
    high = HEIGHT - 2 * lip
    style = pick(rng, ("bead", "collar", "plain"))
    hole = narrow * 0.75
    if style == "bead":
        ring = arc((narrow, HEIGHT - lip), lip, -90, 90, 8)
        side = join(line((radius, low), (narrow, high)), ring)
        outer = narrow
    elif style == "collar":
        outer = narrow + lip
        depth = (HEIGHT - low) * span(rng, 0.15, 0.4)
        corners = [(narrow, HEIGHT - depth), (outer, HEIGHT - depth), (outer, HEIGHT)]
        side = line((radius, low), *corners)
    else:
        outer = narrow
        side = line((radius, low), (narrow, HEIGHT))
    depth = low + 0.3 * (HEIGHT - low)
    inside = line((outer, HEIGHT), (hole, HEIGHT), (hole, depth), (0.0, depth))
    return join(side, inside), (outer, HEIGHT)


def _closure(rng: Generator, mouth: tuple[float, float]) -> list[Part]:
    """Build a cork, a cap, a stopper or a pump (facing +z) on the mouth, or nothing."""
    radius, high = mouth
    style = pick(rng, ("open", "open", "cork", "cap", "cap", "stopper", "pump"))
    if style == "open":
        return []
    if style == "cork":
        cork, rise = radius * 0.78, radius * span(rng, 0.4, 1.2)
        return [loft(line((cork, high - 0.05), (1.05 * cork, high + rise)))]
    wide, rise = radius * span(rng, 1.12, 1.5), radius * span(rng, 0.5, 1.6)
    skirt = high - min(0.12, 0.5 * rise)
    if style == "cap":
        return [loft(line((wide, skirt), (wide * span(rng, 0.85, 1.0), high + rise)))]
    if style == "stopper":
        ball = radius * span(rng, 0.8, 1.5)
        return [loft(arc((0.0, high + 0.8 * ball), (ball, ball), -80, 90, 10))]
    head = high + rise
    arm, bar = wide * span(rng, 1.2, 2.2), 0.3 * wide
    path = fillet([(0.0, head + bar), (arm, head + bar), (arm + 0.1, head - 0.6 * bar)], bar, 4)
    return [
        loft(line((wide, skirt), (wide, high + 0.4 * rise)), segments=24),
        loft(line((bar, high), (bar, head + 0.5 * bar)), segments=16),
        loft(line((1.5 * bar, head), (1.5 * bar, head + 2 * bar)), segments=24),
        tube(path, 0.8 * bar, across=(0.0, 0.0, 1.0), segments=12),
    ]
