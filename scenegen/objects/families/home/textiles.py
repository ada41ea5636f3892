"""Beds, cushions, curtains and rugs, in metres."""

import math

import numpy as np
from numpy.random import Generator

from scenegen.objects.families.parts.draws import chance, pick, span
from scenegen.objects.families.parts.moves import moved, turn_about_x
from scenegen.objects.families.parts.profiles import line
from scenegen.objects.families.parts.soft import bevelled, four, pad, pillow, posts
from scenegen.objects.families.parts.surfaces import Part, loft, made_of
from scenegen.objects.families.parts.sweeps import tube


def bed(rng: Generator) -> list[Part]:
    """Build a made bed, single or double, whose head is at -z."""
    wide = pick(rng, (span(rng, 0.9, 1.0), span(rng, 1.4, 1.6), span(rng, 1.6, 1.8)))
    long, top = 2.04, span(rng, 0.42, 0.55)
    thick = span(rng, 0.18, 0.24)
    rail, under = span(rng, 0.12, 0.2), top - thick
    x, z = wide / 2, long / 2
    head = span(rng, 0.8, 1.15)
    style = pick(rng, ("wood", "wood", "padded", "slats"))
    border, low = 0.03, max(0.04, under - rail + 0.06)
    frame = [((s * x - border, low, -z), (s * x + border, low + rail, z)) for s in (1, -1)]
    frame += [((-x, low, z - border), (x, low + rail, z + border))]
    frame += [((-x, under - 0.03, -z), (x, under, z - border))]
    parts = made_of("frame", bevelled(frame, 0.004))
    back = -z - 0.03
    if style == "padded":
        count = pick(rng, (1, 2, 4))
        step = 2 * (x + 0.04) / count
        for i in range(count):
            left = -x - 0.04 + i * step
            panel = pad((left, 0.0, back - 0.05), (left + step, head, back + 0.05), 0.025, 0.0)
            parts += made_of("cover", panel)
    elif style == "slats":
        count = round(wide / 0.12)
        slats = [(-x + wide * (i + 0.5) / count, back) for i in range(count)]
        bars = posts([(x, back), (-x, back)], 0.025, 0.0, head) + posts(
            slats, 0.01, under, head - 0.05
        )
        bars += [((-x, y, back - 0.012), (x, y + 0.06, back + 0.012)) for y in (head - 0.1, under)]
        parts += made_of("frame", bevelled(bars, 0.003))
    else:
        board = ((-x - 0.03, 0.0, back - 0.02), (x + 0.03, head, back + 0.02))
        parts += made_of("frame", bevelled([board], 0.008))
    legs = posts(four(x - 0.03, z - 0.06), 0.03, 0.0, low + 0.02)
    parts += made_of("frame", bevelled(legs, 0.003))
    return parts + _bedding(rng, wide, long, under, top)


def _bedding(rng: Generator, wide: float, long: float, under: float, top: float) -> list[Part]:
    """Build mattress, blanket, sheet, sometimes a throw, and pillows."""
    x, z = wide / 2, long / 2
    inset = 0.02
    mattress = pad((-x + inset, under, -z + 0.01), (x - inset, top, z - 0.05), 0.04)
    parts = made_of("sheet", mattress)
    fold = -z + span(rng, 0.55, 0.75)  # where the blanket begins
    side = span(rng, 0.0, 0.04)
    blanket = pad(
        (-x - side, top - 0.14, fold), (x + side, top + 0.05, z - 0.02), 0.035, 0.02, corner=0.06
    )
    parts += made_of("blanket", blanket)
    cuff = pad(
        (-x - side - 0.004, top - 0.12, fold - 0.02),
        (x + side + 0.004, top + 0.062, fold + 0.22),
        0.03,
        0.006,
        corner=0.03,
    )
    parts += made_of("sheet", cuff)
    if chance(rng, 0.5):  # a throw across the foot
        start = z - span(rng, 0.55, 0.7)
        cloth = pad(
            (-x - side - 0.008, top - 0.16, start),
            (x + side + 0.008, top + 0.06, start + 0.45),
            0.03,
            0.01,
            corner=0.02,
        )
        parts += made_of("throw", cloth)
    count = 1 if wide < 1.2 else 2
    step = wide / count
    for i in range(count):
        cx = -x + (i + 0.5) * step
        body = pillow(min(0.72, step - 0.08), 0.46, span(rng, 0.14, 0.18))
        tilt = turn_about_x(math.radians(-90 + span(rng, 4, 12)))
        parts += made_of("sheet", moved(body, (cx, top + 0.085, -z + 0.29), tilt))
    return parts


def cushion(rng: Generator) -> list[Part]:
    """Build a cushion that leans back as against the back of a sofa."""
    wide = span(rng, 0.38, 0.5)
    high = wide if chance(rng, 0.7) else span(rng, 0.28, 0.34)
    tilt = turn_about_x(-math.radians(span(rng, 14, 26)))
    return [moved(pillow(wide, high, span(rng, 0.13, 0.19)), (0.0, 0.0, 0.0), tilt)]


def curtain(rng: Generator) -> list[Part]:
    """Build one half of a pair of curtains, gathered in folds, under a rail."""
    wide, high = span(rng, 0.35, 0.7), span(rng, 2.0, 2.35)
    folds = max(3, round(wide / span(rng, 0.075, 0.12)))
    deep = span(rng, 0.022, 0.04)
    t = np.linspace(0.0, 1.0, 12 * folds + 1)
    phase = 2 * math.pi * folds * t
    wander = [span(rng, -0.6, 0.6) for _ in range(4)]
    drift = sum(w * np.sin(2 * math.pi * (k + 1) * t) for k, w in enumerate(wander))
    x = wide * (t - 0.5)
    z = deep * np.sin(phase + drift)
    slope = np.gradient(z, x)
    path = np.stack([x, z], axis=1), np.stack([np.ones_like(x), slope], axis=1)
    middle = (0.0, (high - 0.03) / 2, 0.0)
    cloth = tube(
        path, (high - 0.03) / 2, 0.0016, origin=middle, up=(0.0, 0.0, 1.0), corner=0.001, segments=4
    )
    rail = bevelled(
        [((-wide / 2 - 0.02, high - 0.035, -0.014), (wide / 2 + 0.02, high, 0.014))], 0.003
    )
    return made_of("cloth", cloth) + made_of("rail", rail)


def rug(rng: Generator) -> list[Part]:
    """Build a rug: rectangular or round."""
    x, thick = span(rng, 0.7, 1.3), span(rng, 0.006, 0.014)
    if chance(rng, 0.25):
        side = line((x - 0.004, 0.0), (x, 0.004), (x - 0.003, thick))
        return [loft(side, segments=64)]
    z = x * span(rng, 0.55, 0.75)
    return [pad((-x, 0.0, -z), (x, thick, z), 0.4 * thick, corner=0.01)]
