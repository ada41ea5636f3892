"""Shelves, cabinets, desks and low tables, in metres: boards, fronts, handles and feet."""

import math

from numpy.random import Generator

from scenegen.objects.families.parts.draws import chance, pick, span
from scenegen.objects.families.parts.moves import moved, turn_about_x
from scenegen.objects.families.parts.profiles import arc, fillet, join, line
from scenegen.objects.families.parts.soft import Box, bevelled, four, pad, posts
from scenegen.objects.families.parts.surfaces import Part, loft, made_of
from scenegen.objects.families.parts.sweeps import tube

GAP = 0.003  # between doors and drawers


def shelf(rng: Generator) -> list[Part]:
    """Build a bookcase: tall and narrow, low and wide, or a grid of cubes; with or without back."""
    style = pick(rng, ("tall", "tall", "low", "cubes", "open"))
    board = span(rng, 0.016, 0.03)
    deep = span(rng, 0.26, 0.36)
    if style == "cubes":
        cube = span(rng, 0.32, 0.37)
        columns, rows = pick(rng, (2, 2, 3, 4)), pick(rng, (2, 3, 4, 5))
        wide, high = columns * cube + board, rows * cube + board
    else:
        wide = span(rng, 0.9, 1.6) if style == "low" else span(rng, 0.6, 1.0)
        high = span(rng, 0.7, 1.1) if style == "low" else span(rng, 1.5, 2.05)
        rows = max(2, round(high / span(rng, 0.3, 0.4)))
        columns = 2 if wide > 1.15 else 1
    foot = 0.0 if style in ("cubes", "open") else span(rng, 0.04, 0.1)
    x, z = wide / 2, deep / 2
    parts: list[Box] = [((left, 0.0, -z), (left + board, high, z)) for left in (-x, x - board)]
    inner = x - board
    step = (high - board - foot) / rows
    levels = [foot + i * step for i in range(rows + 1)]
    cell = (2 * inner - (columns - 1) * board) / columns
    lefts = [-inner + i * (cell + board) for i in range(columns)]
    low, top = foot + board, high - board
    parts += [((x0 - board, low, -z + 0.004), (x0, top, z - 0.004)) for x0 in lefts[1:]]
    for y in levels:
        if y in (levels[0], levels[-1]):
            parts.append(((-inner, y, -z), (inner, y + board, z)))
            continue
        parts += [((left, y, -z + 0.006), (left + cell, y + board, z - 0.006)) for left in lefts]
    boards = made_of("board", bevelled(parts, 0.002))
    if foot:
        boards += made_of(
            "board", bevelled([((-inner, 0.0, -z + 0.02), (inner, foot, z - 0.03))], 0.002)
        )
    if style != "open":
        back = bevelled(
            [((-inner, foot + board, -z + 0.002), (inner, high - board, -z + 0.008))], 0.001
        )
        boards += made_of("back", back)
    return boards


def cabinet(rng: Generator) -> list[Part]:
    """Build a sideboard, a chest of drawers or a wardrobe."""
    kind = pick(rng, ("sideboard", "sideboard", "chest", "wardrobe"))
    if kind == "sideboard":
        wide, high, deep = span(rng, 1.1, 1.8), span(rng, 0.6, 0.85), span(rng, 0.38, 0.48)
        columns, rows = pick(rng, (2, 3, 3, 4)), 1
    elif kind == "chest":
        wide, high, deep = span(rng, 0.7, 1.1), span(rng, 0.75, 1.15), span(rng, 0.4, 0.5)
        columns, rows = pick(rng, (1, 1, 2)), pick(rng, (3, 4, 5))
    else:
        wide, high, deep = span(rng, 0.85, 1.5), span(rng, 1.85, 2.1), span(rng, 0.55, 0.62)
        columns, rows = 2 if wide < 1.1 else 3, 1
    foot = span(rng, 0.06, 0.1) if kind == "wardrobe" else span(rng, 0.06, 0.2)
    parts = _case(rng, (wide, high, deep), foot)
    fronts = [(columns, rows)] * columns
    if kind == "sideboard":  # drawers in some columns
        fronts = [(columns, pick(rng, (1, 1, 3))) for _ in range(columns)]
    return parts + _fronts(rng, (wide, high, deep), foot, [n for _, n in fronts])


def nightstand(rng: Generator) -> list[Part]:
    """Build a small chest beside a bed, with one or two drawers or an open compartment."""
    size = span(rng, 0.38, 0.52), span(rng, 0.42, 0.6), span(rng, 0.34, 0.42)
    foot = span(rng, 0.06, 0.22)
    return _case(rng, size, foot) + _fronts(rng, size, foot, [pick(rng, (1, 2, 2, 3))])


Size = tuple[float, float, float]


def _case(rng: Generator, size: Size, foot: float) -> list[Part]:
    """Build a closed case, with a top that may stand over, on feet, a plinth or a sled."""
    wide, high, deep = size
    x, z, top = wide / 2, deep / 2, span(rng, 0.018, 0.03)
    over = pick(rng, (0.0, 0.0, 0.012))
    parts = made_of("case", bevelled([((-x, foot, -z), (x, high - top, z - 0.022))], 0.002))
    lid = bevelled([((-x - over, high - top, -z), (x + over, high, z + over))], 0.004)
    parts += made_of("case", lid)
    style = pick(rng, ("plinth", "tapered", "tapered", "block"))
    if style == "plinth" and foot < 0.1:
        return parts + made_of(
            "case", bevelled([((-x + 0.02, 0.0, -z + 0.02), (x - 0.02, foot, z - 0.05))], 0.002)
        )
    at = four(x - 0.06, z - 0.06)
    if style != "tapered":
        blocks = posts(at, 0.018, 0.0, foot + 0.005)
        return parts + made_of("feet", bevelled(blocks, 0.003))
    lean = [(-0.25 * cx / abs(cx), -0.2 * cz / abs(cz)) for cx, cz in at]
    feet = [(cx - a * foot, cz - b * foot) for (cx, cz), (a, b) in zip(at, lean, strict=True)]
    return parts + made_of(
        "feet", loft(line((0.01, 0.0), (0.02, foot + 0.005)), at=feet, lean=lean, segments=16)
    )


def _fronts(rng: Generator, size: Size, foot: float, rows: list[int]) -> list[Part]:
    """Build doors (one row) or drawers (several) beside each other, with their handles."""
    wide, high, deep = size
    low, top, z = foot + 0.004, high - 0.032, deep / 2
    step = (wide - 0.008) / len(rows)
    style = pick(rng, ("bar", "bar", "knob", "edge"))
    panels, handles, knobs = [], [], []
    for i, count in enumerate(rows):
        left, right = (
            -wide / 2 + 0.004 + i * step + GAP / 2,
            -wide / 2 + 0.004 + (i + 1) * step - GAP / 2,
        )
        for j in range(count):
            gap = (top - low) / count
            bottom, upper = low + j * gap + GAP / 2, low + (j + 1) * gap - GAP / 2
            panels.append(((left, bottom, z - 0.021), (right, upper, z)))
            door = count == 1 and upper - bottom > 0.3
            x = (
                (right - 0.05 if i % 2 == 0 and len(rows) > 1 else left + 0.05)
                if door
                else (left + right) / 2
            )
            y = (bottom + upper) / 2 if not door or high > 1.3 else upper - 0.12
            if style == "knob":
                knobs.append((x, y))
            elif door:
                handles.append((x, y, 0.0, min(0.09, 0.3 * (upper - bottom))))
            else:
                handles.append((x, y, min(0.08, 0.25 * (right - left)), 0.0))
    parts = made_of("front", bevelled(panels, 0.0025))
    if style == "knob":
        return parts + [_knob(x, y, z) for x, y in knobs]
    if style == "edge":
        return parts
    bars: list[Box] = []
    for x, y, a, b in handles:
        bars.append(
            ((x - a - 0.005, y - b - 0.005, z + 0.018), (x + a + 0.005, y + b + 0.005, z + 0.028))
        )
        for s in (1, -1):
            cx, cy = x + s * 0.8 * a, y + s * 0.8 * b
            bars.append(((cx - 0.004, cy - 0.004, z - 0.002), (cx + 0.004, cy + 0.004, z + 0.02)))
    return parts + made_of("handle", bevelled(bars, 0.002))


def _knob(x: float, y: float, z: float) -> Part:
    head = arc((0.0, 0.022), 0.014, -55, 90, 6)
    knob = loft(join(line((0.006, 0.0), (0.006, 0.008), tuple(head[0][0])), head), segments=16)
    turned = moved(knob, (x, y, z - 0.002), turn_about_x(0.5 * math.pi))
    return made_of("handle", turned)[0]


def desk(rng: Generator) -> list[Part]:
    """Build a desk: a top on legs, trestles or drawers."""
    wide, high, deep = span(rng, 1.1, 1.7), span(rng, 0.72, 0.76), span(rng, 0.6, 0.78)
    thick = span(rng, 0.02, 0.035)
    x, z, under = wide / 2, deep / 2, high - thick
    parts = made_of("top", bevelled([((-x, under, -z), (x, high, z))], 0.003))
    style = pick(rng, ("legs", "legs", "frame", "panels", "drawers"))
    if style == "frame":
        bar = 0.018
        path = fillet(
            [(z - 0.06, under), (z - 0.06, bar), (-z + 0.06, bar), (-z + 0.06, under)], 0.02, 3
        )
        sides = [
            tube(
                path,
                bar,
                bar,
                origin=(s * (x - 0.08), 0.0, 0.0),
                across=(0.0, 0.0, 1.0),
                corner=0.004,
            )
            for s in (1, -1)
        ]
        beam = bevelled([((-x + 0.08, under - 0.04, -z + 0.07), (x - 0.08, under, -z + 0.09))])
        return parts + made_of("legs", *sides, beam)
    if style == "drawers":
        box = span(rng, 0.34, 0.44)
        count = pick(rng, (2, 3, 3))
        cx = x - box / 2 - 0.02
        case = _fronts(rng, (box, under + 0.028, 2 * z - 0.03), 0.04, [count])
        shell = made_of(
            "case", bevelled([((-box / 2, 0.0, -z + 0.03), (box / 2, under, z - 0.037))], 0.002)
        )
        parts += [moved(part, (cx, 0.0, 0.0)) for part in shell + case]
    if style == "panels":
        boards: list[Box] = [((-x + 0.04, under - 0.3, -z + 0.06), (x - 0.04, under, -z + 0.08))]
        ends = (x - 0.03, -x + 0.03)
        boards += [((a - 0.014, 0.0, -z + 0.02), (a + 0.014, under, z - 0.02)) for a in ends]
        return parts + made_of("legs", bevelled(boards, 0.002))
    ways = (-1,) if style == "drawers" else (1, -1)
    at = [(sx * (x - 0.06), sz * (z - 0.06)) for sx in ways for sz in (1, -1)]
    corner = pick(rng, (0.1, 1.0))
    thin = span(rng, 0.018, 0.03)
    legs = loft(line((0.7 * thin, 0.0), (thin, under)), at=at, corner=corner, segments=16)
    parts += made_of("legs", legs)
    if style == "legs" and chance(rng, 0.6):
        a, b, drop = x - 0.06, z - 0.06, span(rng, 0.05, 0.1)
        rails = [((-a, under - drop, s * b - 0.01), (a, under, s * b + 0.01)) for s in (1, -1)]
        rails += [((s * a - 0.01, under - drop, -b), (s * a + 0.01, under, b)) for s in (1, -1)]
        parts += made_of("legs", bevelled(rails, 0.002))
    return parts


def coffee_table(rng: Generator) -> list[Part]:
    """Build a low table: round, rounded or square, on legs, a sled or a shelf."""
    high, x = span(rng, 0.36, 0.47), span(rng, 0.35, 0.65)
    style = pick(rng, ("round", "rounded", "square", "square"))
    z = x = min(x, 0.5) if style == "round" else x
    if style != "round":
        z = x * span(rng, 0.45, 0.75)
    thick, corner = span(rng, 0.018, 0.04), {"round": x, "rounded": 0.4 * z, "square": 0.006}[style]
    under = high - thick
    parts = made_of("top", pad((-x, under, -z), (x, high, z), 0.004, corner=corner))
    share = 0.66 if style == "round" else 0.93
    a, b, thin = share * x - 0.03, share * z - 0.03, span(rng, 0.012, 0.024)
    legs = pick(rng, ("four", "four", "sled", "drum" if style == "round" else "panels"))
    if legs == "drum":
        r = span(rng, 0.4, 0.75) * x
        return parts + made_of(
            "legs", loft(join(line((r, 0.0), (r, 0.01)), line((r, 0.01), (0.8 * r, under))))
        )
    if legs == "panels":
        boards: list[Box] = [((s * a - 0.012, 0.0, -b), (s * a + 0.012, under, b)) for s in (1, -1)]
        boards.append(((-a, 0.1, -b + 0.01), (a, 0.12, b - 0.01)))
        return parts + made_of("legs", bevelled(boards, 0.002))
    if legs == "sled":
        path = fillet([(b, under), (b, thin), (-b, thin), (-b, under)], 0.03, 4)
        bars = [
            tube(path, thin, origin=(s * a, 0.0, 0.0), across=(0.0, 0.0, 1.0), corner=0.3 * thin)
            for s in (1, -1)
        ]
        return parts + made_of("legs", *bars)
    at = four(a, b)
    lean = four(-0.12, -0.12)
    feet = loft(line((0.6 * thin, 0.0), (thin, under + 0.002)), at=at, lean=lean, segments=16)
    parts += made_of("legs", feet)
    if style != "round" and chance(rng, 0.4):
        y = 0.35 * under
        parts += made_of(
            "top", bevelled([((-a + 0.02, y, -b + 0.02), (a - 0.02, y + 0.014, b - 0.02))], 0.002)
        )
    return parts
