"""Rotation matrices from quaternions, and cross products."""

from typing import Any

import numpy as np
from numpy.typing import NDArray


def rotation_matrix(quaternion: Any) -> NDArray[np.float64]:
    """Return the rotations of unit quaternions (w, x, y, z), (4, ...), as matrices (..., 3, 3).

    One quaternion, (4,), gives one matrix, (3, 3). The components come first so that four arrays,
    or a plain tuple, can be given. A matrix turns column vectors: `matrix @ vector`.
    """
    w, x, y, z = quaternion
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    matrices = np.array(rows, dtype=float)
    return matrices if matrices.ndim == 2 else np.moveaxis(matrices, (0, 1), (-2, -1))


def cross(a: NDArray[Any], b: NDArray[Any]) -> tuple[Any, Any, Any]:
    """Return the cross product of (3, ...) arrays by components, much faster than NumPy's."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
