"""Patterns: shares between two colours, and heights in metres. They know no colours.

Each is a pure function of small integers. It is kept in memory, so nobody may write into it.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from scenegen.rendering.materials.fields import (
    Field,
    cell_numbers,
    grid,
    noise,
    sampled,
    smoothstep,
)
from scenegen.rendering.materials.material import slopes_of

SIZE = 512  # pixels of a map's side


SHARES, SEAMS = 256, 16  # levels that are told apart


class Pattern(NamedTuple):
    """A pattern of one repeat.

    Attributes:
        shades: SEAMS times the level of the share, plus that of the seam, (n, n) uint16. The share
            goes from the darker to the lighter colour; the seam is 1 in joints, grout and the
            ground of a print, 0 elsewhere.
        slopes: of its bumps, as from `material.slopes_of`, (n, n); None if it is flat.
    """

    shades: Field
    slopes: Field | None

    def share(self) -> Field:
        """Return the share, 0 to 1, (n, n)."""
        return np.asarray((self.shades // SEAMS) / np.float32(SHARES - 1), np.float32)


def levels() -> tuple[Field, Field]:
    """Return share and seam, 0 to 1, of each number of `Pattern.shades`, (SHARES SEAMS,) each."""
    index = np.arange(SHARES * SEAMS, dtype=np.float32)
    return index // SEAMS / np.float32(SHARES - 1), index % SEAMS / np.float32(SEAMS - 1)


@lru_cache(maxsize=12)
def grain(seed: int) -> Field:
    """Return the grain of wood along v, 0.6 m a repeat: 0 dark, 1 light."""
    u, _ = grid(SIZE)
    bend = noise(seed, SIZE, 1.3, (7.0, 1.0))
    fibre = noise(seed + 50, SIZE, 0.2, (30.0, 1.0), lowest=20)
    pores = noise(seed + 51, SIZE, -0.3, (22.0, 1.0), lowest=60)
    wave = (7.0 * u + 1.1 * bend) % 1.0  # early wood turns slowly dark, then a sharp edge
    rings = wave**2.2 * smoothstep(0.0, 0.12, 1.0 - wave)
    share = 0.78 - 0.42 * rings + 0.1 * fibre + 0.06 * bend - 0.3 * smoothstep(1.2, 2.6, pores)
    return np.clip(share, 0.0, 1.0).astype(np.float32)


@lru_cache(maxsize=6)
def board(seed: int) -> Pattern:
    """Return a piece of wood, 0.6 m a repeat."""
    share = grain(seed)
    return _kept(share, 0.00006 * share, 0 * share)


@lru_cache(maxsize=6)
def planks(seed: int, columns: int) -> Pattern:
    """Return floor boards along v, 1.6 m a repeat, `columns` beside each other."""
    size = 2 * SIZE
    u, v = grid(size)
    rng = np.random.default_rng((seed, columns))
    column = np.minimum((u * columns).astype(np.int32), columns - 1)
    starts = (rng.permutation(columns) + 0.3 * rng.random(columns)) / columns
    lengths = 0.38 + 0.24 * rng.random(columns)
    along = (v - starts[column].astype(np.float32)) % 1.0
    second = along > lengths[column]
    board = 2 * column + second
    shade = cell_numbers(seed, board)
    share = sampled(grain(seed % 6), 2.6 * v + 7 * shade, 2.6 * u + 5 * shade)
    share = np.clip(0.62 * share + 0.55 * (shade - 0.32), 0.0, 1.0)
    across = (u * columns) % 1.0
    side = np.minimum(across, 1.0 - across) / columns
    end = np.minimum(along, np.abs(along - lengths[column]))
    end = np.minimum(end, 1.0 - along)
    gap = np.minimum(side + 0 * v, end)
    seam = 1.0 - smoothstep(0.0006, 0.0016, gap)
    return _kept(share, -0.0012 * seam + 0.0001 * share, seam)


@lru_cache(maxsize=6)
def herringbone(seed: int, ratio: int) -> Pattern:
    """Return blocks of wood, `ratio` times as long as wide, laid at right angles."""
    size, period = 2 * SIZE, 2 * ratio
    u, v = grid(size)
    x, y = u * period + 0 * v, v * period + 0 * u
    i, j = x.astype(np.int32), y.astype(np.int32)
    t = (i - j) % period
    flat = t < ratio
    offset = np.where(flat, t, period - 1 - t)
    first, second = np.where(flat, i - offset, i) % period, np.where(flat, j, j - offset) % period
    shade = cell_numbers(seed, first, second, flat)
    along = np.where(flat, x - i, y - j) + offset
    across = np.where(flat, y - j, x - i)
    share = sampled(grain(seed % 6), 0.12 * along + 7 * shade, 0.12 * across + 5 * shade)
    share = np.clip(0.6 * share + 0.55 * (shade - 0.32), 0.0, 1.0)
    gap = np.minimum(np.minimum(across, 1 - across), np.minimum(along, ratio - along))
    seam = 1.0 - smoothstep(0.008, 0.03, gap)
    return _kept(share, -0.0006 * seam, seam)


@lru_cache(maxsize=12)
def tiles(seed: int, columns: int, rows: int) -> Pattern:
    """Return tiles with grout; long ones are shifted by half a tile in every other row."""
    u, v = grid(SIZE)
    y = v * rows + 0 * u
    row = np.minimum(y.astype(np.int32), rows - 1)
    x = (u * columns + (0.5 * (row % 2) if columns < rows else 0.0)) % columns
    column = np.minimum(x.astype(np.int32), columns - 1)
    gap = np.minimum(np.minimum(x % 1, 1 - x % 1) / columns, np.minimum(y % 1, 1 - y % 1) / rows)
    seam = 1.0 - smoothstep(0.0025, 0.0045, gap)
    shade = cell_numbers(seed, column, row)
    cloud = noise(seed, SIZE, 1.0, highest=60)
    share = np.clip(0.5 + 0.5 * (shade - 0.5) + 0.12 * cloud, 0.0, 1.0)
    return _kept(share, -0.0015 * seam + 0.0002 * shade, seam)


@lru_cache(maxsize=6)
def marble(seed: int) -> Pattern:
    """Return stone with veins: the seam is the vein."""
    bend = noise(seed, SIZE, 1.2, highest=24)
    wide = np.abs(noise(seed + 1, SIZE, 1.1, highest=10) + 0.35 * bend)
    thin = np.abs(noise(seed + 2, SIZE, 0.9, highest=22) + 0.3 * bend)
    veins = 0.8 * np.exp(-14 * wide) + 0.45 * np.exp(-20 * thin)
    veins *= smoothstep(-0.8, 1.2, noise(seed + 3, SIZE, 1.3, highest=8))
    share = np.clip(0.6 + 0.16 * bend - 0.3 * veins, 0.0, 1.0)
    return _kept(share, 0 * share, np.clip(veins, 0.0, 1.0))


@lru_cache(maxsize=6)
def speckles(seed: int, coarse: int) -> Pattern:
    """Return granite or speckled glaze: the seam is the speckle."""
    spots = noise(seed, SIZE, -0.2, lowest=coarse / 3, highest=coarse)
    fine = noise(seed + 9, SIZE, 0.3, lowest=10)
    share = np.clip(0.5 + 0.17 * fine, 0.0, 1.0)
    return _kept(share, 0 * share, smoothstep(1.5, 2.2, spots))


@lru_cache(maxsize=6)
def hide(seed: int) -> Pattern:
    """Return leather, 0.4 m a repeat: pebbles between creases; the seam is the crease."""
    bump = noise(seed, SIZE, -0.2, lowest=50, highest=110)
    fold = np.abs(noise(seed + 1, SIZE, 0.4, lowest=6, highest=50))
    crease = np.exp(-7 * np.abs(bump)) * 0.6 + 0.5 * np.exp(-9 * fold)
    cloud = noise(seed + 2, SIZE, 1.4, highest=12)
    share = np.clip(0.6 + 0.13 * cloud - 0.35 * crease, 0.0, 1.0)
    return _kept(share, -0.00022 * crease, crease)


@lru_cache(maxsize=32)
def weave(seed: int, threads: int, style: str) -> Pattern:
    """Return woven cloth of uneven threads: "plain", "twill" or "basket"."""
    u, v = grid(SIZE)
    slub = (
        noise(seed, SIZE, 0.3, (1.0, 24.0), lowest=8),
        noise(seed, SIZE, 0.3, (24.0, 1.0), lowest=8),
    )
    x, y = u * threads + 0 * v, v * threads + 0 * u
    i, j = x.astype(np.int32), y.astype(np.int32)
    over = {
        "plain": (i + j) % 2 == 0,
        "twill": (i + j) % 4 < 2,
        "basket": (i // 2 + j // 2) % 2 == 0,
    }[style]
    round_of = np.where(over, np.sin(np.pi * (x - i)), np.sin(np.pi * (y - j)))
    bow = np.where(over, np.sin(np.pi * (y - j)), np.sin(np.pi * (x - i)))
    thread = np.sqrt(np.maximum(round_of, 0.0)) * (0.72 + 0.28 * bow)
    uneven = np.where(over, slub[1], slub[0])
    fuzz = noise(seed + 3, SIZE, 0.0, lowest=60)
    share = np.clip(0.18 + 0.62 * thread + 0.07 * uneven + 0.05 * fuzz, 0.0, 1.0)
    return _kept(share, 0.00025 * thread, over.astype(np.float32))


@lru_cache(maxsize=6)
def pile(seed: int) -> Pattern:
    """Return the pile of a carpet or felt."""
    tuft = noise(seed, SIZE, -0.1, lowest=40, highest=150)
    tread = noise(seed + 1, SIZE, 1.3, highest=10)
    share = np.clip(0.55 + 0.17 * tuft + 0.07 * tread, 0.0, 1.0)
    return _kept(share, 0.00018 * tuft, smoothstep(-1.0, 1.0, tuft))


@lru_cache(maxsize=6)
def roller(seed: int) -> Pattern:
    """Return the skin of paint from a roller, 1 m a repeat."""
    skin = noise(seed, SIZE, 0.1, lowest=60, highest=220)
    stain = noise(seed + 1, SIZE, 1.7, highest=6)
    return _kept(np.clip(0.6 + 0.14 * stain + 0.03 * skin, 0.0, 1.0), 0.00006 * skin, 0 * skin)


@lru_cache(maxsize=6)
def trowel(seed: int) -> Pattern:
    """Return plaster with strokes of a trowel, 2 m a repeat."""
    stroke = noise(seed, SIZE, 0.9, (1.0, 3.0), lowest=5, highest=90)
    cloud = noise(seed + 1, SIZE, 1.5, highest=12)
    ridge = np.exp(-3 * np.abs(stroke))
    share = np.clip(0.55 + 0.17 * cloud + 0.08 * stroke, 0.0, 1.0)
    return _kept(share, 0.0007 * stroke + 0.0004 * ridge, 0 * share)


@lru_cache(maxsize=16)
def figure(kind: str, count: int, seed: int) -> Field:
    """Return levels of seams: the ground (0) and the figure of a print or of coloured threads."""
    u, v = grid(SIZE)
    x, y = u * count + 0 * v, v * count + 0 * u
    a, b = x % 1 - 0.5, y % 1 - 0.5
    i, j = x.astype(np.int32), y.astype(np.int32)
    soft = 0.5 * count / SIZE + 0.004
    if kind == "stripes":
        shape = smoothstep(-soft, soft, 0.18 - np.abs(a))
    elif kind == "pin":
        shape = smoothstep(-soft, soft, 0.05 - np.abs(a))
    elif kind == "checks":
        shape = 0.5 * smoothstep(-soft, soft, 0.25 - np.abs(a)) + 0.5 * smoothstep(
            -soft, soft, 0.25 - np.abs(b)
        )
    elif kind == "dots":
        shift = np.where(j % 2 == 0, 0.0, 0.5)
        a = (x + shift) % 1 - 0.5
        shape = smoothstep(-soft, soft, 0.24 - np.hypot(a, b))
    elif kind == "zigzag":
        shape = smoothstep(-2 * soft, 2 * soft, 0.25 - np.abs((y + 0.8 * np.abs(a)) % 1 - 0.5))
    elif kind == "diamonds":
        shape = smoothstep(-soft, soft, 0.09 - np.abs(0.5 - np.abs(a) - np.abs(b)))
        shape = np.maximum(shape, smoothstep(-soft, soft, 0.14 - np.abs(a) - np.abs(b)))
    else:  # sprigs: leaves to both sides of a stalk, turned from cell to cell
        turn = (cell_numbers(seed, i, j) * 2 - 1) * 1.2
        c, s = np.cos(turn), np.sin(turn)
        p, q = c * a - s * b, s * a + c * b
        stalk = smoothstep(-soft, soft, 0.012 - np.abs(p)) * (np.abs(q) < 0.34)
        k = (q + 0.3) * 6
        nearest = np.clip(np.round(k), 0, 4) / 6 - 0.3
        away = np.abs(p) - 0.1
        rise = q - nearest - 0.4 * np.abs(p)
        leaf = smoothstep(-0.2, 0.2, 1 - (away / 0.1) ** 2 - (rise / 0.035) ** 2)
        shape = np.maximum(stalk, leaf)
    return _level(np.asarray(shape, np.float32), SEAMS)


@lru_cache(maxsize=3)
def wickerwork(seed: int) -> Pattern:
    """Return basketry, 0.16 m a repeat: weavers around upright stakes."""
    u, v = grid(SIZE)
    stakes, courses = 8, 20
    x, y = u * stakes + 0 * v, v * courses + 0 * u
    j = y.astype(np.int32)
    wave = np.cos(np.pi * (x + j))  # the weaver goes in front of every other stake
    body = np.sqrt(np.maximum(1 - (2 * (y % 1) - 1) ** 2, 0.0))
    shade = cell_numbers(seed, j)
    fibre = noise(seed, SIZE, 0.2, (1.0, 20.0), lowest=20)
    share = np.clip(
        0.15 + 0.55 * body * (0.65 + 0.35 * wave) + 0.2 * (shade - 0.5) + 0.06 * fibre, 0, 1
    )
    return _kept(share, 0.002 * body * (0.6 + 0.4 * wave), 1.0 - body)


def _level(values: Field, count: int) -> Field:
    return np.asarray(np.rint(values.clip(0, 1) * np.float32(count - 1)), np.uint16)


def _kept(share: Field, height: Field, seam: Field) -> Pattern:
    index = _level(share, SHARES) * np.uint16(SEAMS) + _level(seam, SEAMS)
    return Pattern(index, slopes_of(height) if height.any() else None)
