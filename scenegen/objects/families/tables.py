"""Tables: a top on legs, columns, panels or a frame. The long side is along x."""

import math

import numpy as np
from numpy.random import Generator

from scenegen.objects.families.parts.boxes import box, boxes, spoke
from scenegen.objects.families.parts.draws import chance, pick, span
from scenegen.objects.families.parts.moves import buried
from scenegen.objects.families.parts.profiles import bezier, fillet, join, line
from scenegen.objects.families.parts.surfaces import Part, loft, made_of
from scenegen.objects.families.parts.sweeps import tube


def table(rng: Generator) -> list[Part]:
    """Build a table of any height and outline, from a coffee table to a bar table."""
    height = math.exp(span(rng, math.log(0.5), math.log(2.6)))
    depth = math.exp(span(rng, math.log(0.38), 0.0))  # half the depth; half the width is 1
    thick = span(rng, 0.04, 0.22)
    outline = pick(rng, ("square", "square", "rounded", "round", "oval"))
    if outline == "round":
        depth = 1.0
    top = _top(rng, outline, depth, height, thick)
    under = height - thick + 0.02
    if outline in ("round", "oval"):
        kind = pick(rng, (_four, _four, _column, _column, _drum, _crossed))
        return made_of("top", top) + made_of("legs", *kind(rng, 0.68, 0.68 * depth, under))
    kind = pick(rng, (_four, _four, _four, _column, _panels, _trestle, _hairpins))
    return made_of("top", top) + made_of("legs", *kind(rng, 0.93, depth - 0.07, under))


def _top(rng: Generator, outline: str, depth: float, height: float, thick: float) -> Part:
    edge = pick(rng, (0.0, span(rng, 0.2, 1.0) * thick))
    low = height - thick
    side = line((1.0 - edge, low), (1.0, low + 0.5 * edge), (1.0, height))
    if not edge:
        side = line((1.0, low), (1.0, height))
    corner = {"square": 0.0, "rounded": span(rng, 0.15, 0.6) * depth}.get(outline, depth)
    if corner == 0.0:
        return loft(side, size=(1.0, depth), corner=0.0, segments=4)
    return loft(side, size=(1.0, depth), corner=corner)


def _column(rng: Generator, x: float, z: float, top: float) -> list[Part]:
    """Build one column, or two under a long table, on a plate, a bell or feet."""
    thin, reach = span(rng, 0.06, 0.22), min(z, x) * span(rng, 0.6, 0.95)
    at = [(0.0, 0.0)] if x < 1.7 * z else [(0.55 * x, 0.0), (-0.55 * x, 0.0)]
    style = pick(rng, ("plate", "bell", "feet", "urn"))
    if style == "feet":
        turn = pick(rng, (0.0, math.pi / 4))
        angles = [math.pi * 0.5, math.pi * 1.5]
        if len(at) == 1:
            arms = pick(rng, (3, 4))
            angles = [turn + 2 * math.pi * i / arms + math.pi / 2 for i in range(arms)]
        levels = ((0.04, 0.0), (min(0.35, 0.4 * top), 0.07))
        feet = [spoke(cx, angle, reach, 0.7 * thin, levels) for cx, _ in at for angle in angles]
        return [loft(line((thin, 0.04), (thin, top)), at=at, segments=24), boxes(feet)]
    if style == "plate":
        side = line((reach, 0.0), (reach, 0.06), (thin, 0.09), (thin, top))
    elif style == "bell":
        high = span(rng, 0.3, 0.8) * top
        side = join(
            line((reach, 0.0), (reach, 0.04)),
            bezier((reach, 0.04), (0.5 * reach, 0.08), (thin, 0.3 * high), (thin, high), 9),
            line((thin, high), (thin, top)),
        )
    else:
        belly = min(thin * span(rng, 1.5, 2.6), 0.8 * reach)
        waist = (0.7 * thin, 0.6 * top)
        side = join(
            line((reach, 0.0), (reach, 0.07), (thin, 0.12)),
            bezier((thin, 0.12), (belly, 0.2 * top), (belly, 0.55 * top), waist, 9),
            bezier(waist, (0.7 * thin, 0.8 * top), (thin, 0.9 * top), (1.6 * thin, top), 6),
        )
    return [loft(side, at=at, segments=40 if len(at) == 1 else 28)]


def _drum(rng: Generator, x: float, z: float, top: float) -> list[Part]:
    """Build a broad turned body under a round top."""
    foot, waist, head = (span(rng, low, 1.25) for low in (0.5, 0.25, 0.4))
    r = min(x, z)
    y = span(rng, 0.25, 0.75) * top
    side = bezier((foot * r, 0.0), (waist * r, 0.6 * y), (waist * r, y), (head * r, top), 12)
    return [loft(side)]


def _crossed(rng: Generator, x: float, z: float, top: float) -> list[Part]:
    """Build legs that lean past one another, so that each foot is opposite its upper end."""
    count, r = pick(rng, (3, 4)), min(x, z)
    thin, twist = span(rng, 0.04, 0.09), span(rng, 1.6, 2.8)
    angles = [2 * math.pi * i / count + 0.4 for i in range(count)]
    feet = [(r * math.cos(a), r * math.sin(a)) for a in angles]
    heads = [(0.9 * r * math.cos(a + twist), 0.9 * r * math.sin(a + twist)) for a in angles]
    lean = np.subtract(heads, feet) / top
    return [loft(line((thin, 0.0), (thin, top)), at=feet, lean=lean, segments=16)]


def _four(rng: Generator, x: float, z: float, top: float) -> list[Part]:
    """Build four legs, sometimes with an apron, rails or a shelf."""
    thin = span(rng, 0.04, 0.12)
    x, z = x - thin, z - thin
    corners = [(sx * x, sz * z) for sx in (1.0, -1.0) for sz in (1.0, -1.0)]
    style = pick(rng, ("straight", "straight", "tapered", "splayed", "turned", "bent"))
    out = span(rng, 0.06, 0.25) if style == "splayed" else 0.0
    feet = [(cx * (1.0 + out), cz + math.copysign(out * x, cz)) for cx, cz in corners]
    lean = np.subtract(corners, feet) / top
    corner = pick(rng, (0.0, 0.0, 1.0))
    if style == "turned":
        at, bulge = span(rng, 0.3, 0.8) * top, 1.8 * thin
        side = join(
            line((0.6 * thin, 0.0), (0.7 * thin, 0.5 * at)),
            bezier((0.7 * thin, 0.5 * at), (bulge, 0.7 * at), (bulge, at), (0.7 * thin, at), 6),
            line((0.7 * thin, at), (thin, top)),
        )
        legs = loft(side, at=feet, segments=16)
    elif style == "bent":  # a cabriole leg: thin at the foot, thick at the knee
        ankle, knee = (0.3 * thin, 0.4 * top), (1.7 * thin, 0.6 * top)
        side = bezier((0.7 * thin, 0.0), ankle, knee, (1.6 * thin, top), 9)
        legs = loft(side, at=feet, segments=16)
    else:
        foot = thin if style == "straight" else span(rng, 0.35, 0.8) * thin
        legs = loft(line((foot, 0.0), (thin, top)), at=feet, lean=lean, corner=corner, segments=16)
    boards = []
    if chance(rng, 0.55):
        drop, half = span(rng, 0.1, 0.3) * min(1.0, top), 0.3 * thin
        boards += [box((-x, top - drop, s * z - half), (x, top, s * z + half)) for s in (1, -1)]
        boards += [box((s * x - half, top - drop, -z), (s * x + half, top, z)) for s in (1, -1)]
        if chance(rng, 0.4):  # the front of a drawer
            wide = span(rng, 0.2, 0.6) * x
            low, high = top - 0.85 * drop, top - 0.1 * drop
            boards.append(box((-wide, low, z - thin), (wide, high, z + 0.9 * thin)))
    low = span(rng, 0.12, 0.5) * top
    share = 1.0 - low / top
    a, b = x + out * x * share, z + out * x * share
    kind = pick(rng, ("none", "none", "none", "shelf", "rails", "h"))
    if kind == "shelf":
        boards.append(box((-a, low - 0.03, -b), (a, low + 0.03, b)))
    half = 0.35 * thin  # so thin that the hull of legs and top contains it
    low, high = low - half, low + half
    if kind in ("rails", "h"):
        boards += [box((s * a - half, low, -b), (s * a + half, high, b)) for s in (1, -1)]
    if kind == "rails":
        boards += [box((-a, low, s * b - half), (a, high, s * b + half)) for s in (1, -1)]
    if kind == "h":
        boards.append(box((-a, low, -half), (a, high, half)))
    return [legs, buried(boxes(boards))] if boards else [legs]


def _panels(rng: Generator, x: float, z: float, top: float) -> list[Part]:
    """Build upright boards at both ends, with a board, a shelf or drawers between."""
    half = span(rng, 0.03, 0.1)
    a, b = x * span(rng, 0.75, 1.0) - half, z * span(rng, 0.8, 1.0)
    boards = [box((s * a - half, 0.0, -b), (s * a + half, top, b)) for s in (1, -1)]
    kind = pick(rng, ("back", "shelf", "drawers", "drawers"))
    if kind == "back":
        low, z = span(rng, 0.1, 0.6) * top, -0.6 * b
        boards.append(box((-a, low, z - 0.03), (a, top, z + 0.03)))
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
            y, ahead = low + i * gap, b + 0.01
            boards.append(
                box((left + 0.03, y + 0.1 * gap, 0.0), (right - 0.03, y + 0.9 * gap, ahead))
            )
    return [boxes(boards)]


def _trestle(rng: Generator, x: float, z: float, top: float) -> list[Part]:
    """Build two frames, each an A or an X seen from the side, and a beam between them."""
    half, a = span(rng, 0.05, 0.1), x * span(rng, 0.65, 0.95) - 0.1
    crossed = chance(rng, 0.5)
    boards = []
    for sx in (1, -1):
        for sz in (1, -1):
            foot, head = sz * (z - half), sz * (-(z - half) if crossed else 0.15 * z)
            left, right = sx * a - half, sx * a + half
            shift = (0.0, head - foot)
            boards.append(box((left, 0.0, foot - half), (right, top, foot + half), shift))
    y = 0.5 * top if crossed else span(rng, 0.2, 0.6) * top
    boards.append(box((-a, y - half, -half), (a, y + half, half)))
    if not crossed:
        reach = z - half - (0.85 * z - half) * y / top
        thin, low, high = 0.8 * half, y - half, y + half
        boards += [box((s * a - thin, low, -reach), (s * a + thin, high, reach)) for s in (1, -1)]
    return [boxes(boards)]


def _hairpins(rng: Generator, x: float, z: float, top: float) -> list[Part]:
    """Build a bent rod at each end, a loop that stands on the floor."""
    bar, a = span(rng, 0.025, 0.05), x * span(rng, 0.8, 0.97)
    b, foot = 0.95 * z, span(rng, 0.4, 1.0) * z
    path = fillet([(b, top), (foot, bar), (-foot, bar), (-b, top)], 0.3 * foot, 6)
    wide = (bar, 2.5 * bar)
    return [
        tube(path, pick(rng, wide), bar, origin=(s * a, 0.0, 0.0), across=(0.0, 0.0, 1.0))
        for s in (1, -1)
    ]
