"""The positive octant of a sphere around the target, on which cameras and lights are placed."""

import math

import numpy as np

from scenegen.camera import Vector3


def octant_direction(rng: np.random.Generator) -> Vector3:
    """Draw a unit direction uniform by area on the positive octant of the sphere.

    By Archimedes' hat-box theorem its height is uniform.
    """
    height, turn = rng.random(2)
    return octant_point(float(height), float(turn) * math.pi / 2)


def octant_point(height: float, azimuth: float) -> Vector3:
    """Return the unit direction with y = `height` and an azimuth in radians, from +x towards +z."""
    radius = math.sqrt(1.0 - height * height)
    return (radius * math.cos(azimuth), height, radius * math.sin(azimuth))


def around(center: Vector3, radius: float, direction: Vector3) -> Vector3:
    """Return the point at distance `radius` from `center` in a unit direction."""
    x, y, z = (c + radius * d for c, d in zip(center, direction, strict=True))
    return (x, y, z)
