"""Rucksacks, travel bags and cases. Front: +z."""

import numpy as np

from scenegen.objects.families.parts.boxes import box, boxes
from scenegen.objects.families.parts.draws import chance, span
from scenegen.objects.families.parts.moves import moved
from scenegen.objects.families.parts.profiles import arc, bezier, fillet, join, line
from scenegen.objects.families.parts.straps import arch, strap
from scenegen.objects.families.parts.surfaces import Part, loft
from scenegen.objects.families.parts.sweeps import tube

Generator = np.random.Generator


def rucksack(rng: Generator) -> list[Part]:
    """A rounded body with a pocket in front, a loop on top and two straps at the back."""
    height, depth = span(rng, 2.0, 3.2), span(rng, 0.4, 0.75)
    foot = span(rng, 0.75, 1.0)
    dome = height * span(rng, 0.15, 0.45)
    top = span(rng, 0.3, 0.6)
    side = join(
        bezier((foot - 0.1, 0.0), (foot + 0.05, 0.0), (1.0, 0.1), (1.0, 0.3 * height), 7),
        line((1.0, 0.3 * height), (0.97, height - dome)),
        bezier(
            (0.97, height - dome),
            (0.95, height - 0.4 * dome),
            (0.45 * top + 0.55 * 0.97, height),
            (top, height),
            10,
        ),
    )
    corner = depth * span(rng, 0.5, 0.95)
    parts = [loft(side, size=(1.0, depth), corner=corner, segments=32)]
    if chance(rng, 0.85):  # the pocket
        w, h = span(rng, 0.5, 0.85), span(rng, 0.3, 0.5) * height
        out = span(rng, 0.12, 0.35)
        pocket = join(
            arc((w - 0.1, 0.18), 0.1, -90, 0, 5),
            line((w, 0.18), (w, h - 0.15)),
            arc((w - 0.15, h - 0.15), 0.15, 0, 90, 5),
        )
        parts.append(
            loft(
                pocket,
                size=(1.0, 0.3),
                base=(0.0, out - 0.3 * w, 0.6 * out),
                corner=0.0,
                at=(0.0, depth - 0.02),
                segments=24,
            )
        )
    if chance(rng, 0.3):  # a lid over the top
        lid = join(
            line((1.03, height - dome - 0.1), (1.03, height - 0.6 * dome)),
            bezier(
                (1.03, height - 0.6 * dome),
                (1.03, height),
                (0.9, height + 0.05),
                (0.6, height + 0.05),
                6,
            ),
        )
        parts.append(loft(lid, size=(1.0, depth), corner=corner, segments=32))
    parts.append(strap(arch(rng, 0.18, height - 0.1, 0.3), -0.4 * depth * top, 0.05, 0.03))
    far = span(rng, 0.25, 0.6)
    start, end = (-0.6 * depth, 0.88 * height - 0.5 * dome), (-0.8 * depth, 0.15 * height)
    back = bezier(start, (-depth - 1.3 * far, start[1] + 0.1), (-depth - far, end[1]), end, 10)
    one = tube(back, 0.12, 0.035, across=(0.0, 0.0, 1.0), corner=0.03, thin=True)
    parts += [moved(one, (x, 0.0, 0.0)) for x in (0.45, -0.45)]
    return parts


def travel_bag(rng: Generator) -> list[Part]:
    """A long lying body with two handles over its middle."""
    half, radius = span(rng, 1.3, 2.0), span(rng, 0.5, 0.9)
    tall = radius * span(rng, 0.75, 1.15)
    side = arc((0.0, 0.0), (radius, tall), -62, 70, 14)
    swell = span(rng, 0.0, 0.25)
    body = loft(
        side, size=(swell, 1.0), base=(half, 0.0, 0.0), corner=span(rng, 0.3, 0.8), segments=32
    )
    low, spread = 0.7 * tall, half * span(rng, 0.2, 0.4)
    path = arch(rng, spread, low, span(rng, 0.5, 0.9) + 0.3 * tall)
    z = radius * 0.45
    wide = span(rng, 0.05, 0.09)
    return [body, *(strap(path, way * z, wide, 0.03) for way in (1.0, -1.0))]


def case(rng: Generator) -> list[Part]:
    """A brief case, or a suitcase on wheels with its bar drawn out."""
    rolling = chance(rng, 0.5)
    height = span(rng, 1.9, 3.0) if rolling else span(rng, 1.0, 1.6)
    depth = span(rng, 0.35, 0.65) if rolling else span(rng, 0.18, 0.45)
    edge = span(rng, 0.05, 0.25) * depth
    foot = 0.12 if rolling else 0.0
    side = join(
        arc((1.0 - edge, foot + edge), edge, -90, 0, 4),
        line((1.0, foot + edge), (1.0, height - edge)),
        arc((1.0 - edge, height - edge), edge, 0, 90, 4),
    )
    inner = depth - 1.0
    corner = span(rng, 0.1, 0.9) * (depth - edge)
    body = loft(side, size=(1.0, 1.0), base=(0.0, inner, corner), corner=0.0, segments=24)
    half = span(rng, 0.2, 0.35) if not rolling else span(rng, 0.3, 0.6)
    rise = span(rng, 0.2, 0.35) if not rolling else span(rng, 0.5, 1.4)
    corners = [
        (half, height - 0.06),
        (half, height + rise),
        (-half, height + rise),
        (-half, height - 0.06),
    ]
    z = 0.0 if not rolling else -0.6 * (depth - edge)
    parts = [body, strap(fillet(corners, 0.12, 5), z, 0.06, 0.04)]
    if rolling:
        wheels = [
            box((x - 0.08, 0.0, z - 0.07), (x + 0.08, foot + 0.05, z + 0.07))
            for x in (0.75, -0.75)
            for z in (0.5 * depth, -0.5 * depth)
        ]
        parts.append(boxes(wheels))
        ribs = int(4 * rng.random())
        bars = []
        for i in range(ribs):
            x = 1.4 * (i + 0.5) / ribs - 0.7
            bars.append(box((x - 0.06, foot + 0.2, 0.0), (x + 0.06, height - 0.2, depth + 0.04)))
        if bars:
            parts.append(boxes(bars))
    elif chance(rng, 0.6):
        flap = box((-0.9, span(rng, 0.3, 0.6) * height, 0.0), (0.9, height - 0.1, depth + 0.05))
        parts.append(boxes([flap]))
    return parts
