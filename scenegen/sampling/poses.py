"""How objects are turned: at random, or resting on a side."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.common.rotations import rotation_matrix
from scenegen.objects.solids import UnitShape

Array = NDArray[Any]
Quaternion = tuple[float, float, float, float]  # (w, x, y, z), unit


def random_rotation(shape: UnitShape, pose: str, rng: np.random.Generator) -> Quaternion:
    """Draw an orientation, from object to world frame.

    For pose "any" it is uniform on SO(3). For "resting" the shape is dropped in such an
    orientation, settles on the nearest side on which it stays, and is turned about y.
    """
    quaternion = rng.standard_normal(4)
    quaternion /= math.sqrt(quaternion @ quaternion)
    turn = rng.random() * math.pi
    if pose == "any" or not len(shape.resting_directions):
        return _as_tuple(quaternion)
    down = rotation_matrix(_as_tuple(quaternion))[1] * -1.0  # the world's -y, object frame
    side = shape.resting_directions[(shape.resting_directions @ down).argmax()]
    return _multiply((math.cos(turn), 0.0, math.sin(turn), 0.0), _shortest_to_minus_y(side))


def _shortest_to_minus_y(direction: Array) -> Quaternion:
    """Return the smallest rotation that takes the unit `direction` to -y."""
    x, y, z = (float(v) for v in direction)
    if y > 1.0 - 1e-12:
        return (0.0, 1.0, 0.0, 0.0)  # half a turn about x
    # The half-way quaternion (1 + d . -y, d x -y), normalised.
    w = 1.0 - y
    norm = math.sqrt(w * w + z * z + x * x)
    return (w / norm, z / norm, 0.0, -x / norm)


def _multiply(a: Quaternion, b: Quaternion) -> Quaternion:
    """Return the rotation that applies b, then a."""
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )


def _as_tuple(quaternion: Array) -> Quaternion:
    w, x, y, z = (float(v) for v in quaternion)
    return (w, x, y, z)
