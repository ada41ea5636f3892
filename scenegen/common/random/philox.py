"""Philox4x32-10: random bits as a function of a counter and a key, for many counters at once.

The generator of Salmon, Moraes, Dror and Shaw, "Parallel random numbers: as easy as 1, 2, 3"
(2011). It is a bijection of the counters for each key, so that no two counters share their bits.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
ROUNDS = 10
_MULTIPLIERS = np.uint64(0xD2511F53), np.uint64(0xCD9E8D57)
_KEY_STEPS = 0x9E3779B9, 0xBB67AE85
_LOW, _HALF = np.uint64(0xFFFFFFFF), np.uint64(32)


def philox(counter: tuple[Array, Array, Array, Array], key: tuple[int, int]) -> tuple[Array, ...]:
    """Return four words of 32 random bits for each counter of four 32-bit words.

    Words are arrays of uint64 that hold 32 bits, which broadcast; those of the key are integers.
    """
    a, b, c, d = counter
    first, second = key
    for _ in range(ROUNDS):
        left, right = a * _MULTIPLIERS[0], c * _MULTIPLIERS[1]
        a, b = (right >> _HALF) ^ b ^ np.uint64(first), right & _LOW
        c, d = (left >> _HALF) ^ d ^ np.uint64(second), left & _LOW
        first, second = (first + _KEY_STEPS[0]) % 2**32, (second + _KEY_STEPS[1]) % 2**32
    return a, b, c, d
