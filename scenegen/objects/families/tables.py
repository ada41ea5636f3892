"""Tables: a top on legs, columns or panels. The long side is along x."""

import math
from collections.abc import Callable

import numpy as np

from scenegen.objects.families.parts import table_legs
from scenegen.objects.families.parts.boxes import boxes
from scenegen.objects.families.parts.draws import pick, span
from scenegen.objects.families.parts.profiles import bezier, join, line, polyline
from scenegen.objects.families.parts.surfaces import Part, loft

Generator = np.random.Generator


def table(rng: Generator) -> list[Part]:
    """A table: dining, side, coffee, console, desk or bar."""
    height = math.exp(span(rng, math.log(0.5), math.log(2.6)))
    depth = math.exp(span(rng, math.log(0.38), 0.0))  # half of it; half the width is 1
    thick = span(rng, 0.04, 0.22)
    outline = pick(rng, ("square", "square", "rounded", "round", "oval"))
    if outline == "round":
        depth = 1.0
    top = _top(rng, outline, depth, height, thick)
    under = height - thick + 0.02
    round_top = outline in ("round", "oval")
    kinds: tuple[Callable[[Generator, float, float, float], list[Part]], ...] = (
        table_legs.four,
        table_legs.four,
        table_legs.four,
        _column,
        table_legs.panels,
        table_legs.trestle,
        table_legs.hairpins,
    )
    if round_top:
        kinds = (table_legs.four, table_legs.four, _column, _column, _drum, _crossed)
    x, z = (0.68, 0.68 * depth) if round_top else (0.93, depth - 0.07)
    return [top, *pick(rng, kinds)(rng, x, z, under)]


def _top(rng: Generator, outline: str, depth: float, height: float, thick: float) -> Part:
    edge = pick(rng, (0.0, span(rng, 0.2, 1.0) * thick))
    low = height - thick
    side = polyline((1.0 - edge, low), (1.0, low + 0.5 * edge), (1.0, height))
    if not edge:
        side = polyline((1.0, low), (1.0, height))
    corner = {"square": 0.0, "rounded": span(rng, 0.15, 0.6) * depth}.get(outline, depth)
    if corner == 0.0:
        return loft(side, size=(1.0, depth), corner=0.0, segments=4)
    return loft(side, size=(1.0, depth), corner=corner)


def _column(rng: Generator, x: float, z: float, top: float) -> list[Part]:
    """One column, or two along a long table, on a plate, a bell or feet."""
    thin, reach = span(rng, 0.06, 0.22), min(z, x) * span(rng, 0.6, 0.95)
    at = [(0.0, 0.0)] if x < 1.7 * z else [(0.55 * x, 0.0), (-0.55 * x, 0.0)]
    style = pick(rng, ("plate", "bell", "feet", "urn"))
    if style == "feet":
        feet = []
        turn = pick(rng, (0.0, math.pi / 4))
        arms = pick(rng, (3, 4)) if len(at) == 1 else 2
        for cx, _ in at:
            for i in range(arms):
                angle = (
                    turn + 2 * math.pi * i / arms + math.pi / 2 if arms > 2 else math.pi * (i + 0.5)
                )
                feet.append(_foot(cx, angle, reach, 0.7 * thin, min(0.35, 0.4 * top)))
        return [loft(polyline((thin, 0.04), (thin, top)), at=at, segments=24), boxes(feet)]
    if style == "plate":
        side = polyline((reach, 0.0), (reach, 0.06), (thin, 0.09), (thin, top))
    elif style == "bell":
        high = span(rng, 0.3, 0.8) * top
        side = join(
            line((reach, 0.0), (reach, 0.04)),
            bezier((reach, 0.04), (0.5 * reach, 0.08), (thin, 0.3 * high), (thin, high), 9),
            line((thin, high), (thin, top)),
        )
    else:
        belly = min(thin * span(rng, 1.5, 2.6), 0.8 * reach)
        side = join(
            polyline((reach, 0.0), (reach, 0.07), (thin, 0.12)),
            bezier(
                (thin, 0.12), (belly, 0.2 * top), (belly, 0.55 * top), (0.7 * thin, 0.6 * top), 9
            ),
            bezier(
                (0.7 * thin, 0.6 * top),
                (0.7 * thin, 0.8 * top),
                (thin, 0.9 * top),
                (1.6 * thin, top),
                6,
            ),
        )
    return [loft(side, at=at, segments=40 if len(at) == 1 else 28)]


def _foot(
    x: float, angle: float, reach: float, half: float, rise: float
) -> list[tuple[float, float, float]]:
    """A bar from the column down to the floor."""
    c, s = math.cos(angle), math.sin(angle)
    corners = []
    for inner, outer in ((0.04, 0.0), (rise, 0.07)):
        for along, across in ((0.0, -half), (0.0, half), (reach, half), (reach, -half)):
            y = inner if along == 0.0 else outer
            corners.append((x + along * c - across * s, y, along * s + across * c))
    return corners


def _drum(rng: Generator, x: float, z: float, top: float) -> list[Part]:
    """A broad turned body under a round top."""
    foot, waist, head = (span(rng, low, 1.25) for low in (0.5, 0.25, 0.4))
    r = min(x, z)
    y = span(rng, 0.25, 0.75) * top
    side = bezier((foot * r, 0.0), (waist * r, 0.6 * y), (waist * r, y), (head * r, top), 12)
    return [loft(side)]


def _crossed(rng: Generator, x: float, z: float, top: float) -> list[Part]:
    """Legs that lean past one another: each foot is opposite its head."""
    count, r = pick(rng, (3, 4)), min(x, z)
    thin, twist = span(rng, 0.04, 0.09), span(rng, 1.6, 2.8)
    angles = [2 * math.pi * i / count + 0.4 for i in range(count)]
    feet = [(r * math.cos(a), r * math.sin(a)) for a in angles]
    heads = [(0.9 * r * math.cos(a + twist), 0.9 * r * math.sin(a + twist)) for a in angles]
    lean = [
        ((hx - fx) / top, (hz - fz) / top) for (fx, fz), (hx, hz) in zip(feet, heads, strict=True)
    ]
    return [loft(line((thin, 0.0), (thin, top)), at=feet, lean=lean, segments=16)]
