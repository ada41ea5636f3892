"""Rotation matrices from quaternions, cross products, and cosines that are the same everywhere.

NumPy's sums, products, quotients and square roots of doubles are rounded as IEEE 754 says and have
the same bits on every machine. Its cosines, norms and matrix products have not.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

# Taylor coefficients of sin(x) / x and cos(x) in powers of x^2, the highest first: enough for
# |x| <= pi / 4.
_SINE = [(-1) ** k / math.factorial(2 * k + 1) for k in range(8, -1, -1)]
_COSINE = [(-1) ** k / math.factorial(2 * k) for k in range(8, -1, -1)]


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


def cross(a: Any, b: Any) -> tuple[Any, Any, Any]:
    """Return the cross product of (3, ...) arrays by components, much faster than NumPy's."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def product(a: Any, b: Any) -> NDArray[np.float64]:
    """Return the product of small matrices, (..., n, k) and (..., k, m), alike on every machine."""
    terms = (a[..., i, None] * b[..., None, i, :] for i in range(a.shape[-1]))
    return np.asarray(sum(terms, np.float64(0.0)))


def cos_sin(turns: Any) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return cosine and sine of angles in full turns, within 2**-52, alike on every machine."""
    quarters = 4.0 * np.asarray(turns)
    nearest = np.rint(quarters)
    x = (quarters - nearest) * (math.pi / 2)
    square = x * x
    sine, cosine = np.full_like(x, _SINE[0]), np.full_like(x, _COSINE[0])
    for a, b in zip(_SINE[1:], _COSINE[1:], strict=True):
        sine = sine * square + a
        cosine = cosine * square + b
    sine *= x
    quarter = nearest.astype(np.int64) & 3
    odd = (quarter & 1).astype(bool)
    first, second = np.where(odd, sine, cosine), np.where(odd, cosine, sine)
    return (
        np.where((quarter == 1) | (quarter == 2), -first, first),
        np.where(quarter >= 2, -second, second),
    )
