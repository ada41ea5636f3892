"""Pot plants, in metres: upright blades, arching leaves, broad leaves on stalks, small shrubs."""

import math

import numpy as np
from numpy.random import Generator

from scenegen.objects.families.parts.draws import pick, span
from scenegen.objects.families.parts.profiles import bezier, line
from scenegen.objects.families.parts.soft import blades
from scenegen.objects.families.parts.surfaces import Part, loft, made_of
from scenegen.objects.families.parts.sweeps import tube
from scenegen.objects.families.parts.walls import hollow
from scenegen.objects.solids import Array

ROWS = 7  # points along a leaf


def plant(rng: Generator) -> list[Part]:
    """Build a plant small enough for a table, a shelf or a sill."""
    r = span(rng, 0.05, 0.09)
    style = pick(rng, (_upright, _arching, _broad, _broad, _shrub))
    return _pot(rng, r, r * span(rng, 1.5, 2.2)) + style(rng, r, r * 1.6, span(rng, 0.16, 0.32))


def tall_plant(rng: Generator) -> list[Part]:
    """Build a plant that stands on the floor."""
    r = span(rng, 0.13, 0.2)
    style = pick(rng, (_upright, _arching, _broad, _broad, _tree))
    return _pot(rng, r, r * span(rng, 1.5, 2.0)) + style(rng, r, r * 1.5, span(rng, 0.6, 1.1))


def _pot(rng: Generator, r: float, high: float) -> list[Part]:
    foot = r * span(rng, 0.65, 1.0)
    bulge = r * span(rng, 0.9, 1.15)
    wall = bezier((foot, 0.0), (bulge, 0.2 * high), (bulge, 0.6 * high), (r, high), 8)
    thick = 0.06 * r
    at = 0.86 * high
    room = float(np.interp(at, wall[0][:, 1], wall[0][:, 0])) - 0.5 * thick
    earth = loft(line((room - 0.02 * r, at - 0.15 * high), (room, at)), segments=32)
    return made_of("pot", loft(hollow(wall, thick), segments=32)) + made_of("soil", earth)


def _leaves(
    rng: Generator, starts: Array, angles: Array, steep: Array, lengths: Array, droop: float,
    wide: float, power: float,
) -> Part:  # fmt: skip
    """Build leaves that start at points, (n, 3), and rise at angles `steep` and then droop.

    Args:
        angles: directions seen from above, (n,); lengths: of the leaves, (n,).
        droop: by how much a leaf turns down along its length, in radians.
        wide: half width as a share of the length; power: below 1 the widest place is near the base.
    """
    t = np.linspace(0.0, 1.0, ROWS)
    bend = np.array([[span(rng, 0.7, 1.3)] for _ in angles]) * droop
    pitch = steep[:, None] - bend * t
    step = lengths[:, None] / (ROWS - 1)
    flat = np.concatenate([0 * step, np.cumsum(np.cos(pitch[:, :-1]) * step, axis=1)], axis=1)
    up = np.concatenate([0 * step, np.cumsum(np.sin(pitch[:, :-1]) * step, axis=1)], axis=1)
    c, s = np.cos(angles)[:, None], np.sin(angles)[:, None]
    paths = starts[:, None] + np.stack([c * flat, up, s * flat], axis=-1)
    across = np.stack([-s + 0 * flat, 0 * flat, c + 0 * flat], axis=-1)
    width = np.sin(np.pi * t**power) ** 0.75 * wide
    return blades(paths, across, lengths[:, None] * width, fold=0.28)


def _around(rng: Generator, count: int) -> Array:
    """Return directions that follow each other by the golden angle, as leaves do."""
    start = span(rng, 0.0, 6.28)
    return np.array([start + 2.39996 * i + span(rng, -0.25, 0.25) for i in range(count)])


def _upright(rng: Generator, r: float, level: float, tall: float) -> list[Part]:
    """Build stiff upright blades, as of a snake plant."""
    count = 9 + int(9 * rng.random())
    angles = _around(rng, count)
    reach = 0.55 * r * np.sqrt(np.linspace(0.05, 1.0, count))
    starts = np.stack(
        [reach * np.cos(angles), 0 * reach + 0.8 * level, reach * np.sin(angles)], axis=1
    )
    steep = np.array([span(rng, 1.3, 1.5) for _ in angles])
    lengths = tall * np.array([span(rng, 0.55, 1.0) for _ in angles])
    return made_of(
        "leaf",
        _leaves(
            rng, starts, angles, steep, lengths, span(rng, -0.05, 0.1), span(rng, 0.05, 0.075), 0.75
        ),
    )


def _arching(rng: Generator, r: float, level: float, tall: float) -> list[Part]:
    """Build a tuft of long narrow leaves that arch over, as of a spider plant or dracaena."""
    count = 26 + int(22 * rng.random())
    angles = _around(rng, count)
    starts = np.stack(
        [0.25 * r * np.cos(angles), np.full(count, 0.8 * level), 0.25 * r * np.sin(angles)], axis=1
    )
    steep = 1.45 - 0.9 * np.linspace(0.0, 1.0, count)[::-1] ** 1.5
    lengths = tall * np.array([span(rng, 0.8, 1.25) for _ in angles])
    return made_of(
        "leaf",
        _leaves(
            rng, starts, angles, steep, lengths, span(rng, 1.2, 2.1), span(rng, 0.022, 0.035), 0.7
        ),
    )


def _broad(rng: Generator, r: float, level: float, tall: float) -> list[Part]:
    """Build broad leaves, each on a stalk of its own, as of a rubber plant or a calathea."""
    count = 12 + int(12 * rng.random())
    angles = _around(rng, count)
    size = tall * span(rng, 0.32, 0.45)
    stalks, starts = [], []
    for i, angle in enumerate(angles.tolist()):
        share = (i + 0.5) / count
        out, up = tall * (0.42 - 0.3 * share), level + tall * (0.15 + 0.6 * share)
        path = bezier(
            (0.1 * r, 0.75 * level),
            (0.2 * r, 0.5 * (level + up)),
            (0.6 * out, up - 0.05 * tall),
            (out, up),
            6,
        )
        c, s = math.cos(angle), math.sin(angle)
        stalks.append(tube(path, 0.007 * tall + 0.0008, across=(c, 0.0, s), segments=4))
        starts.append((c * (out - 0.004), up, s * (out - 0.004)))
    steep = np.array([span(rng, 0.1, 0.7) for _ in angles])
    lengths = size * np.array([span(rng, 0.75, 1.1) for _ in angles])
    leaves = _leaves(
        rng,
        np.array(starts),
        angles,
        steep,
        lengths,
        span(rng, 0.6, 1.2),
        span(rng, 0.22, 0.34),
        0.8,
    )
    return made_of("stem", *stalks) + made_of("leaf", leaves)


def _shrub(rng: Generator, r: float, level: float, tall: float) -> list[Part]:
    """Build a small bush of many little leaves."""
    del r
    count = 45 + int(25 * rng.random())
    angles = _around(rng, count)
    height = np.array([span(rng, 0.0, 1.0) for _ in angles])
    wide = 0.42 * tall * np.sqrt(np.maximum(1.0 - (height - 0.35) ** 2 / 0.5, 0.05))
    reach = wide * np.array([span(rng, 0.35, 1.0) for _ in angles])
    starts = np.stack(
        [reach * np.cos(angles), level + 0.05 * tall + 0.7 * tall * height, reach * np.sin(angles)],
        axis=1,
    )
    steep = np.array([span(rng, 0.0, 0.9) for _ in angles])
    lengths = tall * np.array([span(rng, 0.2, 0.29) for _ in angles])
    leaves = _leaves(rng, starts, angles, steep, lengths, 0.8, span(rng, 0.26, 0.36), 0.8)
    twigs = []
    for angle in angles[:14].tolist():
        path = bezier(
            (0.0, 0.75 * level),
            (0.02, level + 0.2 * tall),
            (0.15 * tall, level + 0.3 * tall),
            (0.3 * tall, level + 0.6 * tall),
            5,
        )
        twigs.append(tube(path, 0.0022, across=(math.cos(angle), 0.0, math.sin(angle)), segments=4))
    return made_of("stem", *twigs) + made_of("leaf", leaves)


def _tree(rng: Generator, r: float, level: float, tall: float) -> list[Part]:
    """Build a trunk with a crown of leaves, as of a fig."""
    trunk = loft(line((0.011 + 0.05 * r, 0.7 * level), (0.008, level + 0.75 * tall)), segments=12)
    crown = _shrub(rng, r, level + 0.45 * tall, 0.75 * tall)
    return made_of("trunk", trunk) + crown
