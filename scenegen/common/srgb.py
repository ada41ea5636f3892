"""The curve of sRGB (IEC 61966-2-1), between linear values and encoded ones, 0 to 1."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray


def encoded(linear: ArrayLike) -> NDArray[Any]:
    """Return linear values, clipped to 0 to 1, as sRGB."""
    x = np.clip(linear, 0.0, 1.0)
    return np.asarray(np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055))


def decoded(srgb: ArrayLike) -> NDArray[Any]:
    """Return sRGB, 0 to 1, as linear values."""
    x = np.asarray(srgb)
    return np.asarray(np.where(x <= 0.04045, x / 12.92, ((x + 0.055) / 1.055) ** 2.4))
