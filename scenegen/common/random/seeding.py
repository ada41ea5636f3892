"""Random generators, all made here except those of `objects.families.members`.

Every random choice derives from (dataset seed, item index, purpose, attempt), either by a NumPy
generator of its own (`item_rng`) or, for many items at once, by counting (`item_numbers`).
Neighbouring seeds and neighbouring items share no stream (with `seed + index` they would).
"""

from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.common.random.philox import philox


class Purpose(IntEnum):
    """What a stream of random numbers is for. Append only: the numbers are part of the seed."""

    CAMERA = 0
    LIGHTS = 1
    OBJECTS = 2
    POSES = 3
    SELECTION = 4
    QUESTION = 5
    VIEW = 6
    CATALOGUE = 7
    ANSWERS = 8
    POSITIONS = 9
    MODELS = 10
    MATERIALS = 11
    PATHS = 12
    ORDER = 13
    TRAINING = 14
    WEIGHTS = 15
    PICTURES = 16
    QUIZ = 17
    ENVIRONMENT = 18
    ROOM = 19
    ARRANGEMENT = 20
    VIEWPOINT = 21
    CORRUPTION = 22
    PERSPECTIVE = 23
    SURFACE = 24


def item_rng(
    seed: int | tuple[int, ...], index: int, purpose: Purpose, attempt: int = 0
) -> np.random.Generator:
    """Return the generator of one item, purpose and attempt; no number may be negative.

    Further numbers beside the seed keep data sets apart that have it in common. A retry (`attempt`)
    never continues the stream of the one before.
    """
    key = np.random.SeedSequence(seed, spawn_key=(index, int(purpose), attempt))
    return np.random.Generator(np.random.PCG64(key))


def item_seed(seed: int, index: int, purpose: Purpose, attempt: int = 0) -> int:
    """Return 32 bits for generators other than NumPy's; as `item_rng`."""
    key = np.random.SeedSequence(seed, spawn_key=(index, int(purpose), attempt))
    return int(key.generate_state(1)[0])


def item_numbers(
    seed: int, index: Any, purpose: Purpose, attempt: Any = 0, start: Any = 0, *, count: int
) -> NDArray[np.float64]:
    """Return numbers uniform on [0, 1), multiples of 2**-53, of the streams of many items.

    Each (seed, index, purpose, attempt) has a stream of 2**33 numbers, of which these are those
    from `start`, which is even, to start + count - 1. They are the same whatever else is asked for,
    on every machine. Two numbers are one Philox block: its key is a hash of the seed; its counter
    holds the item's index (64 bits), the attempt (24), the purpose (8) and the block's place (32).

    Args:
        index, attempt, start: non-negative integers or arrays of them, which broadcast to a shape
            S.

    Returns: (*S, count). Raises ValueError for a key that the counter cannot hold.
    """
    index, attempt, start = np.broadcast_arrays(*map(np.asarray, (index, attempt, start)))
    if index.size and min(index.min(), attempt.min(), start.min()) < 0:
        raise ValueError("indices, attempts and places in a stream are non-negative")
    if index.size and (attempt.max() >= 2**24 or start.max() + count > 2**33 or (start % 2).any()):
        raise ValueError("attempts are below 2**24; streams start at an even place below 2**33")
    key = np.random.SeedSequence(seed).generate_state(2)
    index = index.astype(np.uint64)[..., None]
    kind = attempt.astype(np.uint64)[..., None] << np.uint64(8) | np.uint64(purpose)
    pairs = np.arange((count + 1) // 2, dtype=np.uint64)
    block = (start // 2).astype(np.uint64)[..., None] + pairs
    low, high = index & np.uint64(2**32 - 1), index >> np.uint64(32)
    words = philox((block, kind, low, high), (int(key[0]), int(key[1])))
    numbers = np.empty((*index.shape[:-1], len(pairs), 2))
    for k in (0, 1):
        bits = words[2 * k] << np.uint64(21) | words[2 * k + 1] >> np.uint64(11)
        np.multiply(bits, 2.0**-53, out=numbers[..., k])
    return numbers.reshape(*index.shape[:-1], -1)[..., :count]
