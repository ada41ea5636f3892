"""Noise as models make it, for what is not to pass for a mistake."""

import numpy as np
from scipy import ndimage


def smooth(seed, shape, width, size):
    """Noise that varies over `width` pixels, of standard deviation `size`."""
    values = np.random.default_rng(seed).normal(size=shape)
    widths = (0, width, width, 0)[: len(shape)]
    values = ndimage.gaussian_filter(values, widths)
    return size * values / values.std()
