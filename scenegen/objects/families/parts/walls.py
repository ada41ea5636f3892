"""Profiles of thin walls, for vessels, lamp shades and the crowns of hats."""

import math

import numpy as np

from scenegen.objects.families.parts.profiles import Curve, arc, inset, join, limited, line, reverse


def hollow(wall: Curve, thickness: float) -> Curve:
    """Return a vessel's profile: outside, round rim, inside and inner floor.

    Args:
        wall: the outside, from the bottom up, without a floor.
        thickness: of wall and floor. Where the wall bends so tightly that its parallel curve would
            turn back, the inner floor begins higher.
    """
    inner, tangents = inset(wall, thickness)
    tip, along = wall[0][-1], wall[1][-1] / math.hypot(*wall[1][-1])
    middle = tip + thickness / 2 * np.array([-along[1], along[0]])
    out = math.degrees(math.atan2(-along[0], along[1]))
    rim = arc((float(middle[0]), float(middle[1])), thickness / 2, out, out + 180, 8)
    ahead = (np.diff(inner, axis=0) * tangents[:-1]).sum(axis=1) > 0.3 * (
        np.diff(wall[0], axis=0) * tangents[:-1]
    ).sum(axis=1)
    floor = wall[0][0, 1] + thickness
    usable = np.append(ahead, True) & (inner[:, 1] >= floor)
    first = len(usable) - int(usable[::-1].argmin()) if not usable.all() else 0
    if first and ahead[first - 1]:  # begin between two rows, where the inside meets the floor
        first -= 1
        (low, high), (before, after) = inner[first : first + 2], tangents[first : first + 2]
        share = (floor - low[1]) / (high[1] - low[1])
        inner[first] = low + share * (high - low)
        tangents = tangents.copy()
        tangents[first] = before + share * (after - before)
    inside = reverse((inner[first:], tangents[first:]))
    end = (float(inside[0][-1, 0]), float(inside[0][-1, 1]))
    return join(wall, rim, inside, line(end, (0.0, end[1])))


def ring(wall: Curve, thickness: float) -> Curve:
    """Return a closed profile, for `closed` lofts: the wall and its inside, with flat edges."""
    inner = reverse(inset(wall, limited(wall, thickness)))
    ends = [_corner(wall, -1), _corner(inner, 0), _corner(inner, -1), _corner(wall, 0)]
    return join(wall, line(*ends[:2]), inner, line(*ends[2:]))


def shell(wall: Curve, thickness: float) -> Curve:
    """Return a closed profile as `ring` does, for a dome whose wall ends on the axis."""
    inner = reverse(inset(wall, limited(wall, thickness)))
    inner[0][0, 0] = 0.0
    return join(wall, inner, line(_corner(inner, -1), _corner(wall, 0)))


def _corner(curve: Curve, row: int) -> tuple[float, float]:
    return float(curve[0][row, 0]), float(curve[0][row, 1])
