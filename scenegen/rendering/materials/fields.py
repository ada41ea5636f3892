"""Tileable fields, (n, n) float32, from which patterns are drawn. Each is computed once a process.

Rows go along v, columns along u; both run over one repeat.
"""

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

Field = NDArray[Any]


@lru_cache(maxsize=64)
def noise(
    seed: int, size: int, falloff: float, stretch: tuple[float, float] = (1.0, 1.0),
    lowest: float = 0.0, highest: float = 1e9,
) -> Field:  # fmt: skip
    """Return noise whose amplitude falls with frequency**-falloff, of mean 0 and deviation 1.

    Args:
        stretch: factors by which features are longer along v and u.
        lowest, highest: bounds of the frequencies, in waves per repeat of the unstretched noise.
    """
    rng = np.random.default_rng((seed, size))
    v = np.fft.fftfreq(size, 1 / size).astype(np.float32)[:, None] * np.float32(stretch[0])
    u = np.fft.rfftfreq(size, 1 / size).astype(np.float32)[None] * np.float32(stretch[1])
    frequency = np.hypot(u, v)
    frequency[0, 0] = 1.0
    amplitude = frequency ** np.float32(-1.0 - falloff)
    amplitude *= (frequency >= lowest) & (frequency <= highest)
    amplitude[0, 0] = 0.0
    angle = np.float32(2 * np.pi) * rng.random(amplitude.shape, np.float32)
    waves = np.empty(angle.shape, np.complex64)
    waves.real, waves.imag = amplitude * np.cos(angle), amplitude * np.sin(angle)
    values = np.fft.irfft2(waves, (size, size))
    values /= values.std()
    values.flags.writeable = False
    return values


def grid(size: int) -> tuple[Field, Field]:
    """Return u (1, n) and v (n, 1) of the pixels' centres, 0 to 1."""
    centres = (np.arange(size, dtype=np.float32) + np.float32(0.5)) / np.float32(size)
    return centres[None], centres[:, None]


def smoothstep(low: float, high: float, values: Field) -> Field:
    """Return 0 below `low`, 1 above `high`, and a smooth step between."""
    share = np.clip((values - low) / (high - low), 0.0, 1.0)
    return np.asarray(share * share * (3 - 2 * share), np.float32)


def sampled(field: Field, rows: Field, columns: Field) -> Field:
    """Return the field at places in repeats, which may lie outside 0 to 1; nearest neighbour."""
    size = len(field)
    i = (rows * size).astype(np.int32) % size
    j = (columns * size).astype(np.int32) % size
    return np.asarray(field.ravel()[i * size + j])


def cell_numbers(rng_seed: int, *numbers: Field) -> Field:
    """Return a number from 0 to 1 for each tuple of small integers: the same for the same tuple."""
    table = np.random.default_rng(rng_seed).random(4096, np.float32)
    index = sum(
        number.astype(np.int32) * k for number, k in zip(numbers, (1, 61, 1009), strict=False)
    )
    return np.asarray(table[np.asarray(index) % 4096])
