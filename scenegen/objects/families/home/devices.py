"""Screens, clocks, floor lamps and pendant lamps. Screens and clocks are in metres."""

import math

from numpy.random import Generator

from scenegen.objects.families import lamps
from scenegen.objects.families.parts.draws import chance, pick, span
from scenegen.objects.families.parts.moves import buried, moved, turn_about_x, turn_about_z
from scenegen.objects.families.parts.profiles import arc, bezier, join, line
from scenegen.objects.families.parts.soft import bevelled, close_fitting, pad
from scenegen.objects.families.parts.surfaces import Part, loft, made_of
from scenegen.objects.families.parts.walls import ring


def screen(rng: Generator) -> list[Part]:
    """Build a television or a monitor on its stand."""
    television = chance(rng, 0.5)
    wide = span(rng, 0.85, 1.3) if television else span(rng, 0.5, 0.72)
    high, x, rise = (
        wide * 9 / 16,
        wide / 2,
        span(rng, 0.05, 0.08) if television else span(rng, 0.1, 0.16),
    )
    edge = span(rng, 0.006, 0.012)
    case = bevelled([((-x, rise, -0.02), (x, rise + high, 0.012))], 0.004)
    bulge = bevelled(
        [((-0.6 * x, rise + 0.1 * high, -0.045), (0.6 * x, rise + 0.7 * high, -0.015))], 0.012
    )
    glass = bevelled(
        [((-x + edge, rise + edge + 0.004, 0.0), (x - edge, rise + high - edge, 0.0128))], 0.0003
    )
    parts = made_of("case", case, bulge) + made_of("screen", glass)
    if television and chance(rng, 0.6):
        feet = []
        for s in (1, -1):
            feet.append(((s * 0.72 * x - 0.012, 0.0, -0.11), (s * 0.72 * x + 0.012, 0.012, 0.11)))
            feet.append(
                ((s * 0.72 * x - 0.01, 0.0, -0.012), (s * 0.72 * x + 0.01, rise + 0.02, 0.0))
            )
        return parts + made_of("stand", bevelled(feet, 0.002))
    a = 0.3 * wide if television else span(rng, 0.1, 0.14)
    base = pad((-a, 0.0, -0.1), (a, 0.012, 0.1), 0.004, corner=pick(rng, (0.01, 0.09)))
    neck = bevelled([((-0.028, 0.008, -0.036), (0.028, rise + 0.3 * high, -0.016))], 0.004)
    return parts + made_of("stand", base, neck)


def clock(rng: Generator) -> list[Part]:
    """Build a round or square wall clock that hangs with its back at -z."""
    r, deep = span(rng, 0.12, 0.2), span(rng, 0.025, 0.045)
    bar = span(rng, 0.006, 0.02)
    corner = pick(rng, (r, r, r, 0.15 * r))
    flat = corner < r
    edge = min(0.3 * bar, 0.004)
    side = join(
        line((r, 0.0), (r, deep - edge)),
        arc((r - edge, deep - edge), edge, 0, 90, 4),
        line((r - edge, deep), (r - bar, deep), (r - bar, 0.0), (r, 0.0)),
    )
    shape = (
        {"base": (0.0, 0.0, 0.0), "corner": 1.0}
        if not flat
        else {"base": (0.0, 0.0, 0.0), "corner": 0.15}
    )
    rim = loft(side, segments=64, closed=True, **shape)  # type: ignore[arg-type]
    inside = r - bar + 0.002
    face = loft(line((inside, 0.002), (inside, deep - 0.014)), segments=64, **shape)  # type: ignore[arg-type]
    up = turn_about_x(math.pi / 2)
    place = (0.0, r, 0.0)
    parts = made_of("rim", close_fitting(moved(rim, place, up))) + made_of(
        "dial", buried(moved(face, place, up))
    )
    level = deep - 0.014
    hands = []
    minute, hour = 6.283 * rng.random(), 6.283 * rng.random()
    for k, (angle, reach, thin) in enumerate(((hour, 0.5, 0.005), (minute, 0.75, 0.0035))):
        z = level + 0.001 + 0.002 * k
        hand = bevelled([((-thin, -0.12 * r, z), (thin, reach * inside, z + 0.0015))], 0.0004)
        hands.append(moved(hand, place, turn_about_z(angle)))
    pin = moved(loft(line((0.007, level - 0.001), (0.007, level + 0.006)), segments=16), place, up)
    return parts + made_of("hand", *hands, pin)


def floor_lamp(rng: Generator) -> list[Part]:
    """Build a lamp that stands on the floor, as `lamps.lamp` builds them."""
    height, radius = span(rng, 3.4, 4.6), span(rng, 0.45, 0.7)
    return lamps._pole(rng, height) + lamps._shade(rng, height, radius)


def pendant(rng: Generator) -> list[Part]:
    """Build a lamp that hangs from the ceiling, whose rose is its highest point."""
    r, rise, cord = span(rng, 0.14, 0.28), span(rng, 0.14, 0.26), span(rng, 0.25, 0.6)
    crown = span(rng, 0.03, 0.05)
    style = pick(rng, ("dome", "dome", "cone", "drum", "globe"))
    top = rise + cord
    rose = loft(line((0.05, top - 0.025), (0.045, top)), segments=32)
    wire = loft(line((0.0025, rise - 0.01), (0.0025, top - 0.02)), segments=8)
    parts = made_of("metal", rose, wire)
    if style == "globe":
        r = min(r, 0.2)
        ball = loft(arc((0.0, rise - 0.9 * r), r, -90, 78, 20))
        cap = loft(line((0.3 * r, rise - 0.02), (0.2 * r, rise + 0.02)), segments=24)
        return parts + made_of("glow", ball) + made_of("metal", cap)
    if style == "dome":
        wall = bezier((r, 0.0), (r, 0.6 * rise), (2.5 * crown, rise), (crown, rise), 12)
    elif style == "cone":
        wall = line((r, 0.0), (crown, rise), strips=4)
    else:
        wall = line((r, 0.0), (0.97 * r, rise), strips=3)
    shade = loft(ring(wall, 0.0025), closed=True, segments=48)
    kind = "shade" if style == "drum" else "metal shade"
    parts += made_of(kind, shade)
    hub = loft(line((crown + 0.004, rise - 0.012), (0.5 * crown, rise + 0.02)), segments=24)
    bulb = loft(arc((0.0, 0.42 * rise), 0.035, -90, 80, 10), segments=20)
    socket = loft(line((0.018, 0.42 * rise + 0.025), (0.018, rise)), segments=16)
    if style == "drum":
        spokes = bevelled(
            [
                ((-0.965 * r, rise - 0.016, -0.002), (0.965 * r, rise - 0.012, 0.002)),
                ((-0.002, rise - 0.016, -0.965 * r), (0.002, rise - 0.012, 0.965 * r)),
            ],
            0.0008,
        )
        parts += made_of("metal", spokes)
    return parts + made_of("metal", hub, socket) + made_of("glow", bulb)
