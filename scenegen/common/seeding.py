"""Random generators, all made here except those of `objects.families.members`.

Every random choice derives from (dataset seed, item index, purpose, attempt) through NumPy's
`SeedSequence` spawn keys, so that neighbouring seeds and neighbouring items share no stream
(with `seed + index` they would).
"""

from enum import IntEnum

import numpy as np


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


def item_rng(seed: int, index: int, purpose: Purpose, attempt: int = 0) -> np.random.Generator:
    """Return the generator of one item, purpose and attempt; no number may be negative.

    A retry (`attempt`) never continues the stream of the one before.
    """
    key = np.random.SeedSequence(seed, spawn_key=(index, int(purpose), attempt))
    return np.random.Generator(np.random.PCG64(key))


def item_seed(seed: int, index: int, purpose: Purpose, attempt: int = 0) -> int:
    """Return 32 bits for generators other than NumPy's; as `item_rng`."""
    key = np.random.SeedSequence(seed, spawn_key=(index, int(purpose), attempt))
    return int(key.generate_state(1)[0])
