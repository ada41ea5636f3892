"""What a standing lamp carries: shades, globes, bowls. They sit on a stem of radius 0.05."""

import numpy as np

from scenegen.objects.families.parts.boxes import box, boxes
from scenegen.objects.families.parts.draws import chance, pick, span
from scenegen.objects.families.parts.moves import buried
from scenegen.objects.families.parts.profiles import arc, bezier, line, polyline
from scenegen.objects.families.parts.surfaces import Part, loft
from scenegen.objects.families.parts.walls import ring

Generator = np.random.Generator


def shade(rng: Generator, height: float, radius: float) -> list[Part]:
    """A shade open above and below about the stem's top, on a cross that rests on the stem."""
    rise = min(radius * span(rng, 0.7, 1.7), height * span(rng, 0.55, 0.8))
    low = height - rise * span(rng, 0.55, 0.9)
    high, thick = low + rise, 0.03
    narrow = radius * pick(rng, (span(rng, 0.25, 0.6), span(rng, 0.6, 1.0), 1.0))
    style = pick(rng, ("straight", "straight", "bell", "dome"))
    if style == "straight" or narrow > 0.8 * radius:
        wall = line((radius, low), (narrow, high))
    elif style == "bell":
        waist = narrow + 0.1 * (radius - narrow)
        wall = bezier(
            (radius, low),
            (0.4 * radius + 0.6 * waist, low + 0.3 * rise),
            (narrow, low + 0.5 * rise),
            (narrow, high),
            8,
        )
    else:
        wall = bezier(
            (radius, low),
            (radius, low + 0.6 * rise),
            ((radius + narrow) / 2, high),
            (narrow, high),
            8,
        )
    outline = pick(rng, ("round", "round", "round", "square", "oval"))
    size, corner = (1.0, 1.0), 1.0
    if outline == "square":
        corner = pick(rng, (0.0, 0.25))
    elif outline == "oval":
        size, corner = (1.0, span(rng, 0.55, 0.8)), 0.5
    level = high - 0.12 * rise
    bar = 0.015
    levels = [level, level + 2 * bar]
    level_radius = float(np.interp(levels, wall[0][:, 1], wall[0][:, 0]).min()) - 0.01
    depth = level_radius * size[1]
    cross = [
        box((-level_radius, level, -bar), (level_radius, level + 2 * bar, bar)),
        box((-bar, level, -depth), (bar, level + 2 * bar, depth)),
    ]
    stem = polyline((0.05, height - 0.05), (0.05, max(level + 2 * bar, height)))
    bulb = arc((0.0, level - 0.2 * rise), 0.16 * radius + 0.03, -80, 90, 8)
    parts = [
        loft(ring(wall, thick), size=size, corner=corner, closed=True),
        buried(boxes(cross)),
        loft(stem, segments=16),
        loft(bulb, segments=16),
    ]
    if chance(rng, 0.3):  # a finial
        ball = span(rng, 0.05, 0.1)
        parts += [
            loft(polyline((0.03, level), (0.03, high + ball)), segments=16),
            loft(arc((0.0, high + 1.5 * ball), ball, -80, 90, 8), segments=16),
        ]
    return parts


def globe(rng: Generator, height: float, radius: float) -> list[Part]:
    """A ball, or an egg, on a short collar."""
    tall = radius * span(rng, 0.8, 1.4)
    collar = 0.4 * radius
    ball = arc((0.0, height + 0.9 * tall), (radius, tall), -75, 90, 16)
    return [loft(polyline((collar, height - 0.08), (collar, height + 0.08 * tall))), loft(ball)]


def bowl(rng: Generator, height: float, radius: float) -> list[Part]:
    """A bowl open upwards."""
    rise = radius * span(rng, 0.35, 0.9)
    start, bend = (0.06, height - 0.03), span(rng, 0.3, 1.0)
    wall = bezier(
        start,
        (radius * bend, height - 0.03),
        (radius, height + 0.4 * rise),
        (radius, height + rise),
        10,
    )
    return [
        loft(ring(wall, 0.03), closed=True),
        loft(arc((0.0, height), 0.12, -80, 90, 6), segments=16),
    ]
