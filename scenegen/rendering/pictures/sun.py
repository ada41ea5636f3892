"""Where the sun is at an hour, and its light. It imports no renderer: exports use it."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.description.interiors import Interior

Array = NDArray[Any]
LATITUDE = 47.0  # degrees, at an equinox: the sun rises at 6 and sets at 18
SUNLESS = 2.0  # degrees of height below which there is no sun
SUN = 1.7  # irradiance above the atmosphere, in the units of `sunsky`


def sun_height(hour: float) -> float:
    """Return the height of the sun above the horizon, in degrees."""
    turn = math.cos(math.radians(15 * (hour - 12))) * math.cos(math.radians(LATITUDE))
    return math.degrees(math.asin(turn))


def sun_azimuth(interior: Interior) -> float:
    """Return the direction of the sun, in radians: 0 towards -z, pi / 2 towards +x.

    The sun moves from the left of noon's direction to the right.
    """
    return math.radians(interior.facing_degrees + 15 * (interior.hour - 12))


def sunlight_of(interior: Interior) -> tuple[Array, Array]:
    """Return the unit vector to the sun, world, (3,), and its irradiance, linear RGB, (3,)."""
    height, azimuth = sun_height(interior.hour), sun_azimuth(interior)
    level, up = math.cos(math.radians(height)), math.sin(math.radians(height))
    toward = np.array([level * math.sin(azimuth), up, -level * math.cos(azimuth)])
    if height <= SUNLESS:
        return toward, np.zeros(3)
    # Beer and Lambert through a clear atmosphere, by its optical depth in red, green and blue.
    mass = 1 / (up + 0.15 * (height + 3.9) ** -1.25)
    return toward, SUN * np.exp(-np.array([0.16, 0.22, 0.36]) * mass)
