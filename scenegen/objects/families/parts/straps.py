"""Handles and straps of bags."""

import numpy as np

from scenegen.objects.families.parts.draws import chance, span
from scenegen.objects.families.parts.profiles import Curve, bezier, fillet
from scenegen.objects.families.parts.surfaces import Part
from scenegen.objects.families.parts.sweeps import tube

Generator = np.random.Generator


def strap(path: Curve, z: float, wide: float, thick: float) -> Part:
    """A flat band in the plane of x and y at z."""
    return tube(path, wide, thick, origin=(0.0, 0.0, z), corner=thick, segments=16, thin=True)


def arch(rng: Generator, half: float, low: float, rise: float) -> Curve:
    """A handle's line from (half, low) up and back down to (-half, low): round or square."""
    if chance(rng, 0.6):
        lean = half * span(rng, 0.75, 1.2)
        top = low + rise * 4 / 3
        return bezier((half, low), (lean, top), (-lean, top), (-half, low), 11)
    inward = half * span(rng, 0.75, 1.0)
    corners = [(half, low), (inward, low + rise), (-inward, low + rise), (-half, low)]
    return fillet(corners, min(0.6 * inward, 0.5 * rise), 5)
