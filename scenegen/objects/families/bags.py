"""Bags: hand bags, paper bags, rucksacks, travel bags, cases and sacks. The front is at +z."""

from numpy.random import Generator

from scenegen.objects.families.parts.boxes import box, boxes
from scenegen.objects.families.parts.draws import chance, pick, span
from scenegen.objects.families.parts.moves import moved
from scenegen.objects.families.parts.profiles import Curve, arc, bezier, fillet, join, limited, line
from scenegen.objects.families.parts.surfaces import Part, loft, made_of
from scenegen.objects.families.parts.sweeps import tube
from scenegen.objects.families.parts.walls import hollow


def bag(rng: Generator) -> list[Part]:
    """Build a bag of a random kind."""
    kinds = (_hand_bag, _hand_bag, _hand_bag, _paper_bag, _paper_bag, _rucksack, _rucksack)
    return pick(rng, (*kinds, _travel_bag, _case, _sack))(rng)


def _hand_bag(rng: Generator) -> list[Part]:
    """Build a soft hand bag that narrows upwards, with one or two handles and sometimes a clasp."""
    height = span(rng, 0.9, 2.2)
    narrow = span(rng, 0.55, 1.1)  # half width at the top; 1 at the base
    depth, thin = span(rng, 0.25, 0.55), span(rng, 0.08, 0.22)
    edge = 0.1
    if abs(narrow - 1.0) < 0.12:
        narrow = 0.88
    slope = (depth - thin) / (1.0 - narrow)  # change of the half depth per unit of half width
    slope = max(0.35, min(slope, 1.2))
    base = depth - slope
    bulge = span(rng, 0.0, 0.18)
    low, high = (1.0 + bulge, 0.0), (0.5 + 0.5 * narrow + bulge, 0.6 * height)
    side = bezier((1.0 - edge, 0.0), low, high, (narrow, height), 12)
    least = min(narrow, 1.0 - edge)
    corner = span(rng, 0.3, 0.95) * (base + slope * least)
    body = loft(side, size=(1.0, slope), base=(0.0, base, corner), corner=0.0, segments=32)
    top_depth = base + slope * narrow
    style = pick(rng, ("two", "two", "one", "long"))
    wide, thick = span(rng, 0.04, 0.1), 0.025
    rise = span(rng, 0.35, 0.9) if style != "long" else span(rng, 1.0, 1.8)
    half = narrow * (span(rng, 0.3, 0.65) if style != "long" else 0.85)
    path = _arch(rng, half, height - 0.1, rise)
    at = [0.0] if style != "two" else [0.6 * top_depth, -0.6 * top_depth]
    parts = [body, *(_strap(path, z, min(wide, 0.45 * top_depth + 0.01), thick) for z in at)]
    if chance(rng, 0.4):  # a clasp or a pocket in front
        w, h = span(rng, 0.12, 0.6) * narrow, span(rng, 0.12, 0.45) * height
        y = span(rng, 0.15, 0.5) * height
        front = base + slope * (1.0 + 0.3 * bulge)
        parts += made_of("strap", boxes([box((-w, y, 0.0), (w, y + h, front + 0.06))]))
    return parts


def _paper_bag(rng: Generator) -> list[Part]:
    """Build an upright bag or tote that is open at the top, with cords or bands as handles."""
    height, depth = span(rng, 1.4, 3.2), span(rng, 0.3, 0.7)
    narrow = span(rng, 0.85, 1.2)
    wall = line((1.0, 0.0), (narrow, height))
    thick = 0.05
    corner = pick(rng, (0.0, 0.0, 0.12))
    body = loft(hollow(wall, thick), size=(1.0, depth), corner=corner, segments=24)
    rise, half = span(rng, 0.3, 1.0), narrow * span(rng, 0.25, 0.6)
    path = _arch(rng, half, height - 0.25, rise + 0.25)
    wide = pick(rng, (0.03, span(rng, 0.06, 0.14)))
    z = depth * (narrow - 0.5 * thick)
    if wide > 0.05:
        return [body, *(_band(path, way * z, wide) for way in (1.0, -1.0))]
    return [body, *(_strap(path, way * z, wide, wide) for way in (1.0, -1.0))]


def _band(path: Curve, z: float, wide: float) -> Part:
    """Build a handle whose band lies flat in the plane of x and y at this z."""
    wide = limited(path, wide)
    return tube(path, 0.025, wide, origin=(0.0, 0.0, z), corner=0.02, segments=16, thin=True)


def _sack(rng: Generator) -> list[Part]:
    """Build a bulging sack tied at the neck, or a bucket bag with a shoulder strap."""
    height, foot = span(rng, 1.3, 2.6), span(rng, 0.5, 0.95)
    depth = span(rng, 0.6, 1.0)
    if chance(rng, 0.5):
        neck, frill = span(rng, 0.2, 0.4), span(rng, 0.3, 0.6)
        side = bezier((foot, 0.0), (1.35, 0.05), (1.2, 0.9 * height), (neck, height), 14)
        low, high = (0.7 * neck, height + 0.1), (frill, height + 0.3)
        edge = bezier((neck, height), low, high, (frill, height + 0.45), 7)
        around = arc((0.0, 0.0), 0.98 * neck, 0, 350, 24)
        cord = tube(around, 0.06, origin=(0.0, height, 0.0), up=(0.0, 0.0, 1.0))
        return [loft(join(side, edge)), cord]
    top = span(rng, 0.8, 1.15)
    wall = bezier((foot, 0.0), (1.1 * foot, 0.3 * height), (top, 0.6 * height), (top, height), 8)
    rise = span(rng, 0.6, 1.5)
    path = _arch(rng, top - 0.04, height - 0.15, rise)
    profile = hollow(wall, 0.06)
    return [loft(profile, size=(1.0, depth), corner=depth), _strap(path, 0.0, 0.08, 0.03)]


def _rucksack(rng: Generator) -> list[Part]:
    """Build a rucksack with a pocket in front, a loop on top and two straps at the back."""
    height, depth = span(rng, 2.0, 3.2), span(rng, 0.4, 0.75)
    foot = span(rng, 0.75, 1.0)
    dome = height * span(rng, 0.15, 0.45)
    top = span(rng, 0.3, 0.6)
    bend, end = (0.95, height - 0.4 * dome), (0.45 * top + 0.55 * 0.97, height)
    side = join(
        bezier((foot - 0.1, 0.0), (foot + 0.05, 0.0), (1.0, 0.1), (1.0, 0.3 * height), 7),
        line((1.0, 0.3 * height), (0.97, height - dome)),
        bezier((0.97, height - dome), bend, end, (top, height), 10),
    )
    corner = depth * span(rng, 0.5, 0.95)
    parts = [loft(side, size=(1.0, depth), corner=corner, segments=32)]
    if chance(rng, 0.85):  # the pocket
        w, h = span(rng, 0.5, 0.85), span(rng, 0.3, 0.5) * height
        out = span(rng, 0.12, 0.35)
        pocket = join(
            arc((w - 0.1, 0.18), 0.1, -90, 0, 5),
            line((w, 0.18), (w, h - 0.15)),
            arc((w - 0.15, h - 0.15), 0.15, 0, 90, 5),
        )
        base, at = (0.0, out - 0.3 * w, 0.6 * out), (0.0, depth - 0.02)
        parts.append(loft(pocket, size=(1.0, 0.3), base=base, corner=0.0, at=at, segments=24))
    if chance(rng, 0.3):  # a lid over the top
        edge, high = height - 0.6 * dome, height + 0.05
        curve = bezier((1.03, edge), (1.03, height), (0.9, high), (0.6, high), 6)
        lid = join(line((1.03, height - dome - 0.1), (1.03, edge)), curve)
        parts.append(loft(lid, size=(1.0, depth), corner=corner, segments=32))
    parts.append(_strap(_arch(rng, 0.18, height - 0.1, 0.3), -0.4 * depth * top, 0.05, 0.03))
    far = span(rng, 0.25, 0.6)
    start, end = (-0.6 * depth, 0.88 * height - 0.5 * dome), (-0.8 * depth, 0.15 * height)
    back = bezier(start, (-depth - 1.3 * far, start[1] + 0.1), (-depth - far, end[1]), end, 10)
    strap = tube(back, 0.12, 0.035, across=(0.0, 0.0, 1.0), corner=0.03, thin=True)
    parts += [moved(strap, (x, 0.0, 0.0)) for x in (0.45, -0.45)]
    return parts


def _travel_bag(rng: Generator) -> list[Part]:
    """Build a travel bag: a long horizontal body with two handles over its middle."""
    half, radius = span(rng, 1.3, 2.0), span(rng, 0.5, 0.9)
    tall = radius * span(rng, 0.75, 1.15)
    side = arc((0.0, 0.0), (radius, tall), -62, 70, 14)
    swell = span(rng, 0.0, 0.25)
    corner = span(rng, 0.3, 0.8)
    body = loft(side, size=(swell, 1.0), base=(half, 0.0, 0.0), corner=corner, segments=32)
    low, spread = 0.7 * tall, half * span(rng, 0.2, 0.4)
    path = _arch(rng, spread, low, span(rng, 0.5, 0.9) + 0.3 * tall)
    z = radius * 0.45
    wide = span(rng, 0.05, 0.09)
    return [body, *(_strap(path, way * z, wide, 0.03) for way in (1.0, -1.0))]


def _case(rng: Generator) -> list[Part]:
    """Build a brief case, or a suitcase on wheels with its handle pulled out."""
    rolling = chance(rng, 0.5)
    height = span(rng, 1.9, 3.0) if rolling else span(rng, 1.0, 1.6)
    depth = span(rng, 0.35, 0.65) if rolling else span(rng, 0.18, 0.45)
    edge = span(rng, 0.05, 0.25) * depth
    foot = 0.12 if rolling else 0.0
    side = join(
        arc((1.0 - edge, foot + edge), edge, -90, 0, 4),
        line((1.0, foot + edge), (1.0, height - edge)),
        arc((1.0 - edge, height - edge), edge, 0, 90, 4),
    )
    inner = depth - 1.0
    corner = span(rng, 0.1, 0.9) * (depth - edge)
    body = loft(side, size=(1.0, 1.0), base=(0.0, inner, corner), corner=0.0, segments=24)
    half = span(rng, 0.2, 0.35) if not rolling else span(rng, 0.3, 0.6)
    rise = span(rng, 0.2, 0.35) if not rolling else span(rng, 0.5, 1.4)
    low, high = height - 0.06, height + rise
    corners = [(half, low), (half, high), (-half, high), (-half, low)]
    z = 0.0 if not rolling else -0.6 * (depth - edge)
    parts = [body, _strap(fillet(corners, 0.12, 5), z, 0.06, 0.04)]
    if rolling:
        wheels = [
            box((x - 0.08, 0.0, z - 0.07), (x + 0.08, foot + 0.05, z + 0.07))
            for x in (0.75, -0.75)
            for z in (0.5 * depth, -0.5 * depth)
        ]
        parts.append(boxes(wheels))
        ribs = int(4 * rng.random())
        places = [1.4 * (i + 0.5) / ribs - 0.7 for i in range(ribs)]
        low, high = foot + 0.2, height - 0.2
        if ribs:
            bars = [box((x - 0.06, low, 0.0), (x + 0.06, high, depth + 0.04)) for x in places]
            parts.append(boxes(bars))
    elif chance(rng, 0.6):
        flap = box((-0.9, span(rng, 0.3, 0.6) * height, 0.0), (0.9, height - 0.1, depth + 0.05))
        parts.append(boxes([flap]))
    return parts


def _strap(path: Curve, z: float, wide: float, thick: float) -> Part:
    """Sweep a flat band along a path in the plane of x and y at this z."""
    place = (0.0, 0.0, z)
    band = tube(path, wide, thick, origin=place, corner=thick, segments=16, thin=True)
    return made_of("strap", band)[0]


def _arch(rng: Generator, half: float, low: float, rise: float) -> Curve:
    """Return a handle's centre line, round or square: from (half, low) up and to (-half, low)."""
    if chance(rng, 0.6):
        lean = half * span(rng, 0.75, 1.2)
        top = low + rise * 4 / 3
        return bezier((half, low), (lean, top), (-lean, top), (-half, low), 11)
    inward = half * span(rng, 0.75, 1.0)
    corners = [(half, low), (inward, low + rise), (-inward, low + rise), (-half, low)]
    return fillet(corners, min(0.6 * inward, 0.5 * rise), 5)
