"""Books, boxes and pictures, in metres."""

import math

import numpy as np
from numpy.random import Generator

from scenegen.objects.families.parts.draws import chance, pick, span
from scenegen.objects.families.parts.moves import moved, turn_about_x, turn_about_z
from scenegen.objects.families.parts.soft import Box, bevelled, four, posts
from scenegen.objects.families.parts.surfaces import Part, made_of

COLORS = 4  # of books in a row


def _book(rng: Generator, high: float, deep: float, thick: float) -> list[Part]:
    """Build a closed book that stands upright with its spine towards +z, from x = 0 to `thick`."""
    board, over = span(rng, 0.0015, 0.003), 0.003
    cover: list[Box] = [
        ((0.0, 0.0, -deep / 2), (board, high, deep / 2)),
        ((thick - board, 0.0, -deep / 2), (thick, high, deep / 2)),
        ((0.0, 0.0, deep / 2 - board), (thick, high, deep / 2 + 0.001)),
    ]
    color = 1 + int(COLORS * rng.random())
    pages = ((board, over, -deep / 2 + over), (thick - board, high - over, deep / 2 - board))
    return made_of(f"print {color}", bevelled(cover, 0.001)) + made_of(
        "pages", bevelled([pages], 0.0005)
    )


def book(rng: Generator) -> list[Part]:
    """Build a book that lies on its side, or a pile of up to five."""
    count = pick(rng, (1, 1, 2, 3, 4, 5))
    wide, deep = span(rng, 0.13, 0.2), span(rng, 0.19, 0.27)
    level, parts = 0.0, []
    for i in range(count):
        thick = span(rng, 0.01, 0.038)
        shrink = 1.0 - 0.06 * i * rng.random()
        angle = span(rng, -0.25, 0.25) if count > 1 else 0.0
        c, s = math.cos(angle), math.sin(angle)
        about_y = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
        size = deep * shrink, wide * shrink
        # Turned about z, the book's height runs along x and its thickness along y.
        lie = about_y @ turn_about_z(-math.pi / 2)
        for part in _book(rng, *size, thick):
            centred = moved(part, (0.0, -size[0] / 2, 0.0))
            parts.append(moved(centred, (0.0, level + thick, 0.0), lie))
        level += thick
    return parts


def books(rng: Generator) -> list[Part]:
    """Build a row of upright books, the last of which may lean on the others."""
    count, x = 4 + int(10 * rng.random()), 0.0
    parts: list[Part] = []
    tall, deep = span(rng, 0.19, 0.25), span(rng, 0.13, 0.17)
    for i in range(count):
        high, thick = tall * span(rng, 0.8, 1.12), span(rng, 0.012, 0.042)
        ahead = deep * span(rng, 0.9, 1.1)
        body = _book(rng, high, ahead, thick)
        shift = (x, 0.0, deep / 2 - ahead / 2 - span(rng, 0.0, 0.01))
        if i == count - 1 and chance(rng, 0.5):
            lean = span(rng, 0.12, 0.3)
            shift = (x + high * math.sin(lean) + 0.0005, 0.0, shift[2])
            body = [moved(part, (0.0, 0.0, 0.0), turn_about_z(lean)) for part in body]
        parts += [moved(part, shift) for part in body]
        x += thick + 0.0006
    return parts


def box(rng: Generator) -> list[Part]:
    """Build a cardboard box, closed or open, a storage box with a lid, or a crate of slats."""
    x, high, z = span(rng, 0.12, 0.24), span(rng, 0.14, 0.34), span(rng, 0.1, 0.18)
    wall = 0.004
    style = pick(rng, ("closed", "open", "lid", "lid", "crate"))
    if style == "closed":
        body = made_of("card", bevelled([((-x, 0.0, -z), (x, high, z))], 0.003))
        tape = [((-x - 0.0006, high - 0.06, -0.024), (x + 0.0006, high + 0.0006, 0.024))]
        return body + made_of("tape", bevelled(tape, 0.0004))
    if style == "crate":
        slat, thick = span(rng, 0.05, 0.08), 0.009
        rows = max(2, int(high / (slat + 0.012)))
        high = rows * (slat + 0.012)
        slats: list[Box] = []
        for i in range(rows):
            low, top = i * high / rows + 0.002, i * high / rows + slat
            slats += [((-x, low, s * z - thick / 2), (x, top, s * z + thick / 2)) for s in (1, -1)]
            slats += [((s * x - thick / 2, low, -z), (s * x + thick / 2, top, z)) for s in (1, -1)]
        slats += [
            *posts(four(x - 0.015, z - 0.015), 0.012, 0.0, high),
            ((-x, 0.004, -z), (x, 0.012, z)),
        ]
        return made_of("slats", bevelled(slats, 0.0015))
    sides: list[Box] = [((-x, 0.0, -z), (x, wall, z))]
    sides += [((-x, 0.0, s * z - wall / 2), (x, high, s * z + wall / 2)) for s in (1, -1)]
    sides += [((s * x - wall / 2, 0.0, -z), (s * x + wall / 2, high, z)) for s in (1, -1)]
    if style == "lid":
        deep = span(rng, 0.04, 0.07)
        lid = ((-x - 0.004, high - deep, -z - 0.004), (x + 0.004, high + 0.003, z + 0.004))
        return made_of("body", bevelled([((-x, 0.0, -z), (x, high, z))], 0.004)) + made_of(
            "lid", bevelled([lid], 0.004)
        )
    parts = made_of("card", bevelled(sides, 0.001))
    for s in (1.0, -1.0):  # flaps hang out
        flap = bevelled([((-x, -0.002, 0.0), (x, 0.002, 0.9 * z))], 0.001)
        tilt = span(rng, -0.9, 0.5)
        turn = turn_about_x(-tilt) if s > 0 else turn_about_x(tilt) @ np.diag([-1.0, 1.0, -1.0])
        parts += made_of("card", moved(flap, (0.0, high, s * z), turn))
    return parts


def picture(rng: Generator) -> list[Part]:
    """Build a framed picture, with or without a mount, that hangs with its back at -z."""
    long = math.exp(span(rng, math.log(0.3), math.log(0.9)))
    short = long * pick(rng, (span(rng, 0.62, 0.8), 0.71, 1.0))
    wide, high = (long, short) if chance(rng, 0.5) else (short, long)
    x, bar, deep = wide / 2, span(rng, 0.012, 0.04), span(rng, 0.016, 0.03)
    frame: list[Box] = [((-x, y, 0.0), (x, y + bar, deep)) for y in (0.0, high - bar)]
    frame += [((left, bar, 0.0), (left + bar, high - bar, deep)) for left in (-x, x - bar)]
    parts = made_of("frame", bevelled(frame, 0.0025))
    inner = bar - 0.002
    mount = span(rng, 0.04, 0.09) * min(wide, high) * 1.6 if chance(rng, 0.6) else 0.0
    board = ((-x + inner, inner, 0.001), (x - inner, high - inner, deep - 0.008))
    parts += made_of("mount", bevelled([board], 0.0005))
    side = inner + mount
    sheet = (
        (-x + side, side, 0.002),
        (x - side, high - side, deep - 0.0075 if mount else deep - 0.006),
    )
    return parts + made_of("picture", bevelled([sheet], 0.0004))
