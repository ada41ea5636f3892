"""Bags: hand bags, paper bags, totes, rucksacks, travel bags, cases and sacks. Front: +z."""

import numpy as np

from scenegen.objects.families.parts import luggage
from scenegen.objects.families.parts.boxes import box, boxes
from scenegen.objects.families.parts.draws import chance, pick, span
from scenegen.objects.families.parts.profiles import Curve, arc, bezier, join, line, tightest
from scenegen.objects.families.parts.straps import arch, strap
from scenegen.objects.families.parts.surfaces import Part, loft
from scenegen.objects.families.parts.sweeps import tube
from scenegen.objects.families.parts.walls import hollow

Generator = np.random.Generator


def bag(rng: Generator) -> list[Part]:
    """A bag of some kind."""
    kinds = (
        _hand_bag,
        _hand_bag,
        _hand_bag,
        _paper_bag,
        _paper_bag,
        luggage.rucksack,
        luggage.rucksack,
    )
    return pick(rng, (*kinds, luggage.travel_bag, luggage.case, _sack))(rng)


def _hand_bag(rng: Generator) -> list[Part]:
    """A soft body that narrows upwards, with one or two handles, and a flap at times."""
    height = span(rng, 0.9, 2.2)
    narrow = span(rng, 0.55, 1.1)  # half width at the top; 1 at the base
    depth, thin = span(rng, 0.25, 0.55), span(rng, 0.08, 0.22)
    edge = 0.1
    if abs(narrow - 1.0) < 0.12:
        narrow = 0.88
    slope = (depth - thin) / (1.0 - narrow)  # of the depth with the width
    slope = max(0.35, min(slope, 1.2))
    base = depth - slope
    bulge = span(rng, 0.0, 0.18)
    side = bezier(
        (1.0 - edge, 0.0),
        (1.0 + bulge, 0.0),
        (0.5 + 0.5 * narrow + bulge, 0.6 * height),
        (narrow, height),
        12,
    )
    least = min(narrow, 1.0 - edge)
    corner = span(rng, 0.3, 0.95) * (base + slope * least)
    body = loft(side, size=(1.0, slope), base=(0.0, base, corner), corner=0.0, segments=32)
    top_depth = base + slope * narrow
    style = pick(rng, ("two", "two", "one", "long"))
    wide, thick = span(rng, 0.04, 0.1), 0.025
    rise = span(rng, 0.35, 0.9) if style != "long" else span(rng, 1.0, 1.8)
    half = narrow * (span(rng, 0.3, 0.65) if style != "long" else 0.85)
    path = arch(rng, half, height - 0.1, rise)
    at = [0.0] if style != "two" else [0.6 * top_depth, -0.6 * top_depth]
    parts = [body, *(strap(path, z, min(wide, 0.45 * top_depth + 0.01), thick) for z in at)]
    if chance(rng, 0.4):  # a clasp or a pocket in front
        w, h = span(rng, 0.12, 0.6) * narrow, span(rng, 0.12, 0.45) * height
        y = span(rng, 0.15, 0.5) * height
        front = base + slope * (1.0 + 0.3 * bulge)
        parts.append(boxes([box((-w, y, 0.0), (w, y + h, front + 0.06))]))
    return parts


def _paper_bag(rng: Generator) -> list[Part]:
    """An upright bag open at the top, with cords or bands, or a tote."""
    height, depth = span(rng, 1.4, 3.2), span(rng, 0.3, 0.7)
    narrow = span(rng, 0.85, 1.2)
    wall = line((1.0, 0.0), (narrow, height))
    thick = 0.05
    body = loft(
        hollow(wall, thick),
        size=(1.0, depth),
        corner=pick(rng, (0.0, 0.0, 0.12)),
        segments=24,
    )
    rise, half = span(rng, 0.3, 1.0), narrow * span(rng, 0.25, 0.6)
    path = arch(rng, half, height - 0.25, rise + 0.25)
    wide = pick(rng, (0.03, span(rng, 0.06, 0.14)))
    z = depth * (narrow - 0.5 * thick)
    if wide > 0.05:
        return [body, *(_band(path, way * z, wide) for way in (1.0, -1.0))]
    return [body, *(strap(path, way * z, wide, wide) for way in (1.0, -1.0))]


def _band(path: Curve, z: float, wide: float) -> Part:
    """A band that lies flat in the plane of x and y at z."""
    wide = min(wide, 0.7 * tightest(path))
    return tube(path, 0.025, wide, origin=(0.0, 0.0, z), corner=0.02, segments=16, thin=True)


def _sack(rng: Generator) -> list[Part]:
    """A bulging sack tied at the neck, or a bucket bag with a shoulder strap."""
    height, foot = span(rng, 1.3, 2.6), span(rng, 0.5, 0.95)
    depth = span(rng, 0.6, 1.0)
    if chance(rng, 0.5):
        neck, frill = span(rng, 0.2, 0.4), span(rng, 0.3, 0.6)
        side = join(
            bezier((foot, 0.0), (1.35, 0.05), (1.2, 0.9 * height), (neck, height), 14),
            bezier(
                (neck, height),
                (0.7 * neck, height + 0.1),
                (frill, height + 0.3),
                (frill, height + 0.45),
                7,
            ),
        )
        cord = tube(
            arc((0.0, 0.0), 0.98 * neck, 0, 350, 24),
            0.06,
            origin=(0.0, height, 0.0),
            up=(0.0, 0.0, 1.0),
            segments=16,
        )
        return [loft(side), cord]
    top = span(rng, 0.8, 1.15)
    wall = bezier((foot, 0.0), (1.1 * foot, 0.3 * height), (top, 0.6 * height), (top, height), 8)
    rise = span(rng, 0.6, 1.5)
    path = arch(rng, top - 0.04, height - 0.15, rise)
    profile = hollow(wall, 0.06)
    return [loft(profile, size=(1.0, depth), corner=depth), strap(path, 0.0, 0.08, 0.03)]
