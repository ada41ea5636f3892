"""What is outside the windows: a map of radiance by direction, and the sun.

The sky is Mitsuba's `sunsky`, after Hosek and Wilkie (2012). Below the horizon is ground that the
sky lights, with a line of trees before the sky. A map has latitude and longitude as axes: row 0 is
up, +y, and column 0 is -z, going on towards +x.
"""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import drjit
import mitsuba
import numpy as np
from numpy.typing import NDArray

from scenegen.description.interiors import Interior
from scenegen.rendering.pictures.sun import SUNLESS, sun_azimuth, sun_height, sunlight_of
from scenegen.rendering.tables import upload

Array = NDArray[Any]
dr: Any = drjit  # typed Any, as its stubs are not exact enough
mi: Any = mitsuba
ROWS, COLUMNS = 64, 128  # of the sky
FINE = 6  # pixels of a map, along each side, for one of the sky
DUSK = 3.0  # degrees of height of the sun that lights the sky after sunset
TURBIDITY = 4.0  # of the air: 2 is very clear
GROUND = (0.13, 0.14, 0.08)  # reflectance
TREES = (0.035, 0.055, 0.02)
NIGHT = (3e-5, 4e-5, 7e-5)  # radiance of the sky at night


@dataclass(frozen=True, eq=False)
class Outside:
    """What lights a room from outside.

    Attributes:
        radiance: linear RGB by direction, (rows, columns, 3) float32.
        toward_sun: unit vector, world, (3,).
        sunlight: irradiance at a surface that faces the sun, linear RGB, (3,).
    """

    radiance: Array
    toward_sun: Array
    sunlight: Array


def directions(rows: int, columns: int) -> Array:
    """Return the unit vectors of the pixels of a map, world, (rows, columns, 3)."""
    down = (np.arange(rows) + 0.5)[:, None] / rows * np.pi
    around = (np.arange(columns) + 0.5)[None] / columns * 2 * np.pi
    flat = np.sin(down)
    return np.stack([flat * np.sin(around), np.cos(down) + 0 * around, -flat * np.cos(around)], -1)


def outside(interior: Interior) -> Outside:
    """Return sky, ground and sun of a room's hour."""
    height = sun_height(interior.hour)
    azimuth = sun_azimuth(interior)
    sun, sunlight = sunlight_of(interior)
    night = height < -4
    shown = np.array([math.sin(azimuth), math.tan(math.radians(max(height, DUSK))),
                      -math.cos(azimuth)])  # fmt: skip
    shown /= np.linalg.norm(shown)
    view = directions(ROWS, COLUMNS)
    radiance = _sky(_direction_key(shown))
    if night:
        radiance = np.broadcast_to(np.array(NIGHT, np.float32), radiance.shape).copy()
    elif height < SUNLESS:
        radiance = radiance * np.float32(max(0.02, 0.5 + height / 12))
    weights = np.maximum(view[..., 1], 0) * np.sqrt(np.maximum(1 - view[..., 1] ** 2, 0))
    from_sky = np.pi * (radiance * weights[..., None]).sum((0, 1)) / weights.sum()
    light = (from_sky + sunlight * max(float(sun[1]), 0.0)) / np.pi
    radiance = radiance.repeat(FINE, axis=0).repeat(FINE, axis=1)
    return Outside(_with_ground(radiance, light, interior.facing_degrees), sun, sunlight)


def _with_ground(radiance: Array, light: Array, seed: float) -> Array:
    """Return a map of the sky with a meadow and trees in this light, (H, W, 3) float32."""
    rows, columns = radiance.shape[:2]
    height = np.cos((np.arange(rows) + 0.5) / rows * np.pi)
    turn = (np.arange(columns) + 0.5) / columns * 2 * np.pi
    tops, shade = np.full(columns, 0.055), np.ones(columns)
    for waves, size in ((2, 0.03), (5, 0.025), (13, 0.02), (31, 0.012), (67, 0.007), (131, 0.004)):
        tops += size * np.sin(waves * turn + waves * seed)
        shade += 4 * size * np.sin(1.7 * waves + 2 * waves * turn + seed)
    haze = radiance[rows // 2 - 4].mean(axis=0)
    # Distant things take on the colour of the air.
    meadow = height < 0
    far = np.exp(height[meadow, None] * 14) * 0.25
    radiance[meadow] = ((1 - far) * np.array(GROUND) * light + far * 0.5 * haze)[:, None]
    grown = ~meadow & (height < tops.max())
    lit = (0.55 + 0.45 * height[grown, None] / np.maximum(tops, 1e-3)).clip(0, 1) * shade
    crowns = 0.8 * np.array(TREES) * light * lit[..., None] + 0.2 * 0.5 * haze
    trees = (height[grown, None] < tops)[..., None]
    radiance[grown] = np.where(trees, crowns, radiance[grown])
    return radiance


def _direction_key(direction: Array) -> tuple[float, float, float]:
    x, y, z = (round(float(v), 3) for v in direction)
    return x, y, z


@lru_cache(maxsize=16)
def _sky(sun: tuple[float, float, float]) -> Array:
    """Return the radiance of the sky without the sun's disc, (ROWS, COLUMNS, 3)."""
    # It is not kept: Dr.Jit compiles every emitter that there is into the kernels of paths.
    emitter = mi.load_dict({"type": "sunsky", "sun_direction": [0, 0, 1], "turbidity": TURBIDITY,
                            "sun_scale": 0.0})  # fmt: skip
    parameters = mi.traverse(emitter)
    x, y, z = sun
    toward = mi.Vector3f(*(mi.Float([value]) for value in (x, -z, y)))
    dr.make_opaque(toward)  # so that all hours share a kernel
    parameters["sun_direction"] = toward
    parameters.update()
    view = directions(ROWS, COLUMNS).reshape(-1, 3).astype(np.float32)
    si = dr.zeros(mi.SurfaceInteraction3f, len(view))
    # Its z is up, and `wi` points back.
    back = np.stack([-view[:, 0], view[:, 2], -np.abs(view[:, 1])])
    si.wi = mi.Vector3f(*(upload(axis) for axis in back))
    channels = [*emitter.eval(si)]
    dr.eval(channels)
    found = np.stack([np.asarray(channel, np.float32) for channel in channels], -1)
    return found.reshape(ROWS, COLUMNS, 3)
