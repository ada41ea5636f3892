"""The positive octant of a sphere around the target, on which cameras and lights are placed."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.common.records import Vector3
from scenegen.common.rotations import cos_sin

Array = NDArray[Any]


def octant_points(center: Vector3, radius: float, height: Array, turns: Array) -> Array:
    """Return points (..., 3) on the sphere of a radius around `center`.

    `height` is from -1 to 1 in radii, `turns` the azimuth in full turns, from +x towards +z. For
    both uniform, up to 1 and to 1/4, points are uniform by area on the octant: by Archimedes'
    hat-box theorem a uniform point's height is uniform.
    """
    around = np.sqrt(1.0 - height * height)
    cosine, sine = cos_sin(turns)
    directions = np.broadcast_arrays(around * cosine, height, around * sine)
    return np.stack([c + radius * d for c, d in zip(center, directions, strict=True)], axis=-1)
