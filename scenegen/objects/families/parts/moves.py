"""Turn parts, shift them, or leave them out of the convex body that placement uses."""

import math
from dataclasses import replace

import numpy as np

from scenegen.objects.families.parts.surfaces import Part
from scenegen.objects.solids import Array


def moved(part: Part, offset: tuple[float, float, float], turn: Array | None = None) -> Part:
    """Return a part rotated by the matrix `turn`, (3, 3), if given, and then shifted."""
    shift = np.array(offset)
    if turn is None:
        hull = part.hull_points + shift
        return replace(part, vertices=part.vertices + shift, hull_points=hull)
    # Discs must be horizontal: one that tips over is replaced by a polygon that contains it.
    flat = part.hull_discs > 0.0
    discs = part.hull_discs[flat]
    largest = discs.max(initial=0.0)
    sides = 8 if largest < 0.2 else 12 if largest < 0.36 else 16 if largest < 0.7 else 24
    angle = np.arange(sides) * (2 * np.pi / sides)
    spokes = np.stack([np.cos(angle), 0 * angle, np.sin(angle)], axis=1) / np.cos(np.pi / sides)
    rims = (part.hull_points[flat][:, None] + discs[:, None, None] * spokes).reshape(-1, 3)
    points = np.concatenate([part.hull_points[~flat], rims])
    return replace(
        part,
        vertices=_turned(part.vertices, turn) + shift,
        normals=_turned(part.normals, turn),
        hull_points=_turned(points, turn) + shift,
        hull_discs=np.zeros(len(points)),
    )


def _turned(vectors: Array, turn: Array) -> Array:
    """Rotate vectors, (..., 3), summing in a fixed order: a BLAS product's last bits may vary."""
    x, y, z = (vectors[..., i : i + 1] * turn[:, i] for i in range(3))
    return np.asarray(x + y + z)


def turn_about_x(angle: float) -> Array:
    """Return the rotation matrix about x that turns y towards z by an angle in radians, (3, 3)."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


def turn_about_z(angle: float) -> Array:
    """Return the rotation matrix about z that turns x towards y by an angle in radians, (3, 3)."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def buried(part: Part) -> Part:
    """Return a part without hull points, for one that lies in the convex hull of the others."""
    return replace(part, hull_points=np.empty((0, 3)), hull_discs=np.empty(0))
