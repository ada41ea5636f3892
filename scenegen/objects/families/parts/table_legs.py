"""Tables' legs, panels and frames, below a top with corners."""

import math

import numpy as np

from scenegen.objects.families.parts.boxes import box, boxes
from scenegen.objects.families.parts.draws import chance, pick, span
from scenegen.objects.families.parts.moves import buried
from scenegen.objects.families.parts.profiles import bezier, fillet, join, line
from scenegen.objects.families.parts.surfaces import Part, loft
from scenegen.objects.families.parts.sweeps import tube

Generator = np.random.Generator


def four(rng: Generator, x: float, z: float, top: float) -> list[Part]:
    """Four legs, with an apron, rails or a shelf at times."""
    thin = span(rng, 0.04, 0.12)
    x, z = x - thin, z - thin
    corners = [(sx * x, sz * z) for sx in (1.0, -1.0) for sz in (1.0, -1.0)]
    style = pick(rng, ("straight", "straight", "tapered", "splayed", "turned", "bent"))
    out = span(rng, 0.06, 0.25) if style == "splayed" else 0.0
    feet = [(cx * (1.0 + out), cz + math.copysign(out * x, cz)) for cx, cz in corners]
    lean = [
        ((cx - fx) / top, (cz - fz) / top) for (cx, cz), (fx, fz) in zip(corners, feet, strict=True)
    ]
    corner = pick(rng, (0.0, 0.0, 1.0))
    if style == "turned":
        at, bulge = span(rng, 0.3, 0.8) * top, 1.8 * thin
        side = join(
            line((0.6 * thin, 0.0), (0.7 * thin, 0.5 * at)),
            bezier((0.7 * thin, 0.5 * at), (bulge, 0.7 * at), (bulge, at), (0.7 * thin, at), 6),
            line((0.7 * thin, at), (thin, top)),
        )
        legs = loft(side, at=feet, segments=16)
    elif style == "bent":  # cabriole: the foot is thin, the knee stands out
        side = bezier(
            (0.7 * thin, 0.0),
            (0.3 * thin, 0.4 * top),
            (1.7 * thin, 0.6 * top),
            (1.6 * thin, top),
            9,
        )
        legs = loft(side, at=feet, segments=16)
    else:
        foot = thin if style == "straight" else span(rng, 0.35, 0.8) * thin
        legs = loft(line((foot, 0.0), (thin, top)), at=feet, lean=lean, corner=corner, segments=16)
    boards = []
    if chance(rng, 0.55):
        drop, half = span(rng, 0.1, 0.3) * min(1.0, top), 0.3 * thin
        boards += [box((-x, top - drop, s * z - half), (x, top, s * z + half)) for s in (1, -1)]
        boards += [box((s * x - half, top - drop, -z), (s * x + half, top, z)) for s in (1, -1)]
        if chance(rng, 0.4):  # a drawer's front
            wide = span(rng, 0.2, 0.6) * x
            boards.append(
                box((-wide, top - 0.85 * drop, z - thin), (wide, top - 0.1 * drop, z + 0.9 * thin))
            )
    low = span(rng, 0.12, 0.5) * top
    share = 1.0 - low / top
    a, b = x + out * x * share, z + out * x * share
    kind = pick(rng, ("none", "none", "none", "shelf", "rails", "h"))
    if kind == "shelf":
        boards.append(box((-a, low - 0.03, -b), (a, low + 0.03, b)))
    half = 0.35 * thin  # thinner than any leg, whose hull with the top's holds it
    if kind in ("rails", "h"):
        boards += [
            box((s * a - half, low - half, -b), (s * a + half, low + half, b)) for s in (1, -1)
        ]
    if kind == "rails":
        boards += [
            box((-a, low - half, s * b - half), (a, low + half, s * b + half)) for s in (1, -1)
        ]
    if kind == "h":
        boards.append(box((-a, low - half, -half), (a, low + half, half)))
    return [legs, buried(boxes(boards))] if boards else [legs]


def panels(rng: Generator, x: float, z: float, top: float) -> list[Part]:
    """Upright boards at both ends, a board or drawers between."""
    half = span(rng, 0.03, 0.1)
    a, b = x * span(rng, 0.75, 1.0) - half, z * span(rng, 0.8, 1.0)
    boards = [box((s * a - half, 0.0, -b), (s * a + half, top, b)) for s in (1, -1)]
    kind = pick(rng, ("back", "shelf", "drawers", "drawers"))
    if kind == "back":
        boards.append(
            box((-a, span(rng, 0.1, 0.6) * top, -0.6 * b - 0.03), (a, top, -0.6 * b + 0.03))
        )
    elif kind == "shelf":
        y = span(rng, 0.15, 0.6) * top
        boards.append(box((-a, y - 0.03, -b + 0.01), (a, y + 0.03, b - 0.01)))
    else:
        inner, low = a - span(rng, 0.4, 0.7) * a, span(rng, 0.05, 0.5) * top
        side = pick(rng, (1.0, -1.0))
        left, right = sorted((side * inner, side * (a - 0.5 * half)))
        boards.append(box((left, low, -b + 0.02), (right, top, b - 0.03)))
        count = 1 + int(3 * rng.random())
        gap = (top - low) / count
        for i in range(count):
            y = low + i * gap
            boards.append(
                box((left + 0.03, y + 0.1 * gap, 0.0), (right - 0.03, y + 0.9 * gap, b + 0.01))
            )
    return [boxes(boards)]


def trestle(rng: Generator, x: float, z: float, top: float) -> list[Part]:
    """Two frames, an A or an X seen from the side, and a beam."""
    half, a = span(rng, 0.05, 0.1), x * span(rng, 0.65, 0.95) - 0.1
    crossed = chance(rng, 0.5)
    boards = []
    for sx in (1, -1):
        for sz in (1, -1):
            foot, head = sz * (z - half), sz * (-(z - half) if crossed else 0.15 * z)
            bar = box(
                (sx * a - half, 0.0, foot - half),
                (sx * a + half, top, foot + half),
                (0.0, head - foot),
            )
            boards.append(bar)
    y = 0.5 * top if crossed else span(rng, 0.2, 0.6) * top
    boards.append(box((-a, y - half, -half), (a, y + half, half)))
    if not crossed:
        reach = z - half - (0.85 * z - half) * y / top
        boards += [
            box((s * a - 0.8 * half, y - half, -reach), (s * a + 0.8 * half, y + half, reach))
            for s in (1, -1)
        ]
    return [boxes(boards)]


def hairpins(rng: Generator, x: float, z: float, top: float) -> list[Part]:
    """A bent rod at each end: a loop that stands on the floor."""
    bar, a = span(rng, 0.025, 0.05), x * span(rng, 0.8, 0.97)
    b, foot = 0.95 * z, span(rng, 0.4, 1.0) * z
    path = fillet([(b, top), (foot, bar), (-foot, bar), (-b, top)], 0.3 * foot, 6)
    return [
        tube(
            path, pick(rng, (bar, 2.5 * bar)), bar, origin=(s * a, 0.0, 0.0), across=(0.0, 0.0, 1.0)
        )
        for s in (1, -1)
    ]
