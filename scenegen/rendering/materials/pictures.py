"""Materials whose map covers a piece once: pictures, screens, clock faces, rugs, leaves, prints.

Row 0 is the lower edge.
"""

import itertools

import numpy as np
from numpy.random import Generator

from scenegen.objects.families.parts.draws import chance, pick, span
from scenegen.rendering.materials.fields import Field, grid, noise, smoothstep
from scenegen.rendering.materials.material import Array, Material, lerp
from scenegen.rendering.materials.palettes import Color, Palette, linear
from scenegen.rendering.materials.patterns import Pattern

SIZE = 256


def _over(canvas: Array, color: Array | Color, share: Field) -> None:
    rows = np.flatnonzero(share.any(axis=1))
    part = slice(rows[0], rows[-1] + 1) if len(rows) else slice(0)
    canvas[part] += share[part, :, None] * (np.asarray(color, np.float32) - canvas[part])


def picture(rng: Generator, palette: Palette) -> Material:
    """Draw a picture in the room's colours: shapes, hills, arches, strokes, blocks or a twig."""
    style = pick(rng, (_shapes, _hills, _hills, _arches, _strokes, _field, _twig))
    paper = pick(rng, (palette.neutrals[0], palette.neutrals[1], linear("efe6d4")))
    canvas = np.empty((SIZE, SIZE, 3), np.float32)
    canvas[:] = paper
    style(rng, canvas, (*palette.accents, *palette.fabrics[:3]))
    grainy = 1.0 + 0.03 * noise(int(4 * rng.random()), SIZE, 0.2)
    return Material(np.clip(canvas * grainy[..., None], 0.0, 0.9), span(rng, 0.3, 0.8))


Colors = tuple[Color, ...]


def _shapes(rng: Generator, canvas: Array, colors: Colors) -> None:
    u, v = grid(SIZE)
    for _ in range(3 + int(5 * rng.random())):
        x, y, r = span(rng, 0.15, 0.85), span(rng, 0.15, 0.85), span(rng, 0.08, 0.3)
        kind = pick(rng, ("disc", "half", "bar", "ring"))
        away = np.hypot(u - x, v - y)
        share = smoothstep(-0.004, 0.004, r - away)
        if kind == "half":
            share = share * (v > y)
        elif kind == "ring":
            share = smoothstep(-0.004, 0.004, 0.02 - np.abs(away - r))
        elif kind == "bar":
            share = smoothstep(
                -0.004, 0.004, np.minimum(r - np.abs(u - x), 0.25 * r - np.abs(v - y))
            )
        _over(canvas, pick(rng, colors), share)


def _hills(rng: Generator, canvas: Array, colors: Colors) -> None:
    """Draw ranges of hills under a sky, paler with distance."""
    u, v = grid(SIZE)
    low, high = np.array(pick(rng, colors)), np.array(linear("e8ecec"))
    sky = 0.35 * low + 0.65 * high
    canvas[:] = lerp(0.6 * high + 0.4 * np.array(linear("f2d9b8")), sky, v + 0 * u)
    if chance(rng, 0.5):
        x, y, r = span(rng, 0.2, 0.8), span(rng, 0.6, 0.85), span(rng, 0.04, 0.09)
        _over(canvas, linear("f6e3b4"), smoothstep(-0.004, 0.004, r - np.hypot(u - x, v - y)))
    near = np.array(pick(rng, colors)) * 0.5
    count = 3 + int(3 * rng.random())
    row = noise(int(6 * rng.random()), SIZE, 0.9)
    for k in range(count):
        share = (k + 1) / count
        skyline = 0.62 - 0.5 * share + 0.05 * row[17 * k % SIZE][None] * (1.2 - 0.5 * share)
        _over(canvas, sky + (near - sky) * share**1.2, smoothstep(-0.003, 0.003, skyline - v))


def _arches(rng: Generator, canvas: Array, colors: Colors) -> None:
    u, v = grid(SIZE)
    x, base = span(rng, 0.4, 0.6), span(rng, 0.12, 0.3)
    for k in range(5):
        r = 0.34 - 0.065 * k
        body = np.where(v < base + 0.3, np.abs(u - x), np.hypot(u - x, v - base - 0.3))
        share = smoothstep(-0.004, 0.004, r - body) * (v > base)
        _over(canvas, colors[(k + int(4 * rng.random())) % len(colors)], share)


def _strokes(rng: Generator, canvas: Array, colors: Colors) -> None:
    u, v = grid(SIZE)
    for _ in range(4 + int(4 * rng.random())):
        angle, at, wide = span(rng, -0.5, 0.5), span(rng, 0.1, 0.9), span(rng, 0.02, 0.09)
        rough = noise(int(6 * rng.random()), SIZE, 0.5, (1.0, 8.0))
        bend = at + angle * (u - 0.5) + span(rng, -0.4, 0.4) * (u - 0.5) ** 2
        share = smoothstep(-0.01, 0.01, wide - np.abs(v - bend) + 0.01 * rough)
        ends = smoothstep(0.0, 0.05, u - span(rng, 0.02, 0.3)) * smoothstep(
            0.0, 0.05, span(rng, 0.7, 0.98) - u
        )
        _over(canvas, pick(rng, colors), share * ends)


def _field(rng: Generator, canvas: Array, colors: Colors) -> None:
    """Draw two or three soft blocks of colour above each other."""
    u, v = grid(SIZE)
    canvas[:] = np.array(pick(rng, colors)) * 0.7
    edges = sorted([0.06, 0.94, *(span(rng, 0.25, 0.75) for _ in range(1 + chance(rng, 0.5)))])
    rough = 0.012 * noise(int(6 * rng.random()), SIZE, 0.6)
    for low, high in itertools.pairwise(edges):
        inside = np.minimum(np.minimum(u - 0.07, 0.93 - u), np.minimum(v - low, high - v)) - 0.015
        _over(canvas, pick(rng, colors), 0.92 * smoothstep(-0.012, 0.02, inside + rough))


def _twig(rng: Generator, canvas: Array, colors: Colors) -> None:
    u, v = grid(SIZE)
    ink = np.array(pick(rng, (linear("3f4f3a"), linear("2f3b3a"), colors[0]))) * 0.9
    curve = span(rng, -0.3, 0.3)
    stalk = 0.5 + curve * (v - 0.1) * (v - 0.9)
    _over(
        canvas, ink, smoothstep(-0.004, 0.004, 0.004 - np.abs(u - stalk)) * ((v > 0.1) & (v < 0.88))
    )
    for k in range(9):
        y = 0.22 + 0.075 * k
        for way in (1.0, -1.0):
            turn, long = way * span(rng, 0.6, 1.0), 0.17 - 0.011 * k
            x = 0.5 + curve * (y - 0.1) * (y - 0.9)
            p, q = u - x, v - y
            along, across = p * np.sin(turn) + q * np.cos(turn), p * np.cos(turn) - q * np.sin(turn)
            share = 1 - ((along - long / 2) / (long / 2)) ** 2 - (across / (0.24 * long)) ** 2
            _over(canvas, ink * span(rng, 0.8, 1.5), smoothstep(-0.05, 0.1, share))


def screen(rng: Generator, palette: Palette) -> Material:
    """Draw a screen that is off, or shows a page of text and pictures in quiet colours."""
    u, v = grid(SIZE)
    canvas = np.full((SIZE, SIZE, 3), 0.012, np.float32)
    if chance(rng, 0.35):
        canvas[:] = palette.neutrals[2] if chance(rng, 0.5) else linear("1d2430")
        _over(canvas, linear("3a4250"), (v > 0.94) * (u >= 0))
        x, lines = span(rng, 0.2, 0.4), np.random.default_rng(int(9 * rng.random())).random(40)
        row = np.minimum((v * 30).astype(int), 39)
        text = (v * 30 % 1 < 0.45) & (u > x) & (u < x + 0.55 * lines[row]) & (v > 0.35) & (v < 0.88)
        _over(canvas, palette.neutrals[3], text.astype(np.float32))
        box = (u > x) & (u < 0.95) & (v > 0.06) & (v < 0.3)
        _over(canvas, pick(rng, palette.fabrics), 0.6 * box.astype(np.float32))
    return Material(canvas, 0.08)


def dial(rng: Generator, palette: Palette) -> Material:
    """Draw the face of a clock, without hands."""
    u, v = grid(SIZE)
    x, y = 2 * u - 1, 2 * v - 1
    light = chance(rng, 0.75)
    face = palette.neutrals[0] if light else palette.neutrals[4]
    ink = palette.neutrals[4] if light else palette.neutrals[0]
    canvas = np.empty((SIZE, SIZE, 3), np.float32)
    canvas[:] = face
    r, turn = np.hypot(x, y), np.arctan2(y, x) / (2 * np.pi)
    for count, low, wide in ((12, 0.72, 0.022), (60, 0.84, 0.008)):
        across = np.abs((turn * count + 0.5) % 1 - 0.5) * 2 * np.pi / count * r
        share = smoothstep(-0.006, 0.006, wide - across) * ((r > low) & (r < 0.9))
        _over(canvas, ink, share.astype(np.float32))
    return Material(canvas, 0.5)


def rug(rng: Generator, ground: Color, colors: Colors, pile: Pattern) -> Material:
    """Draw a rug with a border and a field of figures, or in one colour."""
    size = len(pile.shades)
    u, v = grid(size)
    canvas = np.empty((size, size, 3), np.float32)
    canvas[:] = ground
    style = pick(rng, ("plain", "bands", "diamonds", "medallion", "checks"))
    first, second = pick(rng, colors), pick(rng, colors)
    edge = np.minimum(np.minimum(u, 1 - u), 1.5 * np.minimum(v, 1 - v))
    soft = 0.004
    if style == "bands":
        for k in range(9):
            at, wide = (k + 0.5) / 9, span(rng, 0.008, 0.04)
            color = pick(rng, colors)
            _over(canvas, color, smoothstep(-soft, soft, wide - np.abs(u - at)) + 0 * v)
    elif style in ("diamonds", "checks"):
        a, b = np.abs((u * 8) % 1 - 0.5), np.abs((v * 6) % 1 - 0.5)
        inner = 0.34 - a - b if style == "diamonds" else 0.27 - np.maximum(a, b)
        _over(canvas, first, smoothstep(-0.03, 0.03, inner))
        _over(canvas, second, smoothstep(-0.03, 0.03, inner - 0.17))
    elif style == "medallion":
        x, y = np.abs(2 * u - 1), np.abs(2 * v - 1)
        r, turn = np.hypot(1.2 * x, y), np.arctan2(y, x)
        star = r * (1 + 0.12 * np.cos(8 * turn))
        for k in range(4):
            _over(
                canvas,
                (first, second, ground, first)[k],
                smoothstep(-soft, soft, 0.62 - 0.14 * k - star),
            )
        corner = np.hypot(1 - x, 1 - y)
        _over(canvas, second, smoothstep(-soft, soft, 0.4 - corner))
    if style != "plain":
        for low, high, color in ((0.0, 0.09, second), (0.02, 0.035, ground), (0.055, 0.07, first)):
            _over(
                canvas,
                color,
                smoothstep(-soft, soft, edge - low) * smoothstep(-soft, soft, high - edge),
            )
    canvas *= (0.62 + 0.55 * pile.share())[..., None]
    bumps = 0.5  # the map spans metres, not half a metre
    return Material(np.minimum(canvas, 0.85), 0.98, None, pile.slopes, bumps, specular=0.05)


def leaf(rng: Generator, palette: Palette) -> Material:
    """Draw a leaf: the middle rib along v at u = 0.5, ribs to both sides, paler or darker edges."""
    del palette
    u, v = grid(SIZE)
    green = np.array(
        linear(pick(rng, ("3f6b33", "2f5a2e", "5a7f3c", "46703f", "6a8f4a", "35583f")))
    )
    side = np.abs(u - 0.5)
    canvas = lerp(
        0.75 * green,
        1.1 * green,
        np.clip(0.5 + 0.2 * noise(int(6 * rng.random()), SIZE, 0.8), 0, 1),
    )
    ribs = smoothstep(-0.12, 0.12, 0.1 - np.abs((9 * (v - 0.9 * side)) % 1 - 0.5))
    _over(canvas, 1.35 * green, 0.35 * ribs)
    if chance(rng, 0.3):
        pale = np.array(linear(pick(rng, ("d9dba0", "b9c98a", "c9cfae"))))
        stripe = pick(rng, (0.34, -0.12))
        _over(
            canvas, pale, smoothstep(-0.05, 0.05, (side - stripe) if stripe > 0 else (0.12 - side))
        )
    _over(canvas, 1.7 * green, smoothstep(-0.012, 0.012, 0.022 - side) + 0 * v)
    return Material(np.clip(canvas, 0.0, 0.8), span(rng, 0.3, 0.55))


def bands(rng: Generator, color: Color, other: Color, rough: float) -> Material:
    """Draw a colour with a few bands across v and, on some, a line of letters; 0.3 m a repeat."""
    u, v = grid(SIZE)
    canvas = np.empty((SIZE, SIZE, 3), np.float32)
    canvas[:] = color
    for _ in range(pick(rng, (0, 1, 2, 3))):
        at, wide = rng.random(), span(rng, 0.006, 0.05)
        away = np.abs((v - at + 0.5) % 1 - 0.5)
        _over(canvas, other, smoothstep(-0.004, 0.004, wide - away) + 0 * u)
    if chance(rng, 0.4):  # a line of letters
        letters = noise(int(6 * rng.random()), SIZE, -0.5, lowest=40, highest=90)
        line = np.abs((v - rng.random() + 0.5) % 1 - 0.5) < 0.012
        ink = 0.8 if sum(color) < 0.6 else 0.05
        _over(canvas, (ink, ink, ink), 0.7 * smoothstep(0.2, 0.6, letters) * line)
    return Material(canvas, rough, metres=0.3)
