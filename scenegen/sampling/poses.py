"""How objects are turned: at random, or resting on a side."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.common.rotations import cos_sin, rotation_matrix
from scenegen.sampling.bodies import Bodies

Array = NDArray[Any]


def random_rotations(bodies: Bodies, kind: Array, pose: str, numbers: Array) -> Array:
    """Return orientations, from object to world frame, as unit quaternions (w, x, y, z): (N, 4).

    For pose "any" they are uniform on SO(3). For "resting" a shape is dropped in such an
    orientation, settles on the nearest side on which it stays, and is turned about y.

    Args:
        kind: which of `bodies` each is, (N,).
        numbers: four for each, uniform on [0, 1), (N, 4).
    """
    share = numbers[:, 0]
    (w, y, cosine), (z, x, sine) = cos_sin(numbers[:, 1:].T * [[1.0], [1.0], [0.5]])
    # Shoemake, "Uniform random rotations" (1992).
    low, high = np.sqrt(share), np.sqrt(1.0 - share)
    quaternion = np.stack([low * w, high * x, high * y, low * z], axis=-1)
    if pose == "any":
        return quaternion
    down = -rotation_matrix(quaternion.T)[:, 1]  # the world's -y, object frame
    side = bodies.resting_side(kind, down)
    rests = _multiply((cosine, 0.0, sine, 0.0), _shortest_to_minus_y(side))
    return np.where(np.isnan(side[:, :1]), quaternion, rests)


def _shortest_to_minus_y(directions: Array) -> tuple[Array, ...]:
    """Return the smallest rotations that take unit directions, (N, 3), to -y, as (w, x, y, z)."""
    x, y, z = directions.T
    opposite = y > 1.0 - 1e-12  # then half a turn about x
    # The half-way quaternion (1 + d . -y, d x -y), normalised.
    w = 1.0 - y
    norm = np.where(opposite, 1.0, np.sqrt(w * w + z * z + x * x))
    zero = np.zeros_like(w)
    return (
        np.where(opposite, 0.0, w / norm),
        np.where(opposite, 1.0, z / norm),
        zero,
        np.where(opposite, 0.0, -x / norm),
    )


def _multiply(a: tuple[Any, ...], b: tuple[Any, ...]) -> Array:
    """Return the rotations that apply b, then a, (N, 4)."""
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return np.stack(
        [
            aw * bw - ax * bx - ay * by - az * bz,
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
        ],
        axis=-1,
    )
