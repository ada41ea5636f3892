"""Streams of random numbers: frozen, and shared by no two (seed, index, purpose, attempt)."""

import itertools

import numpy as np
import pytest

from scenegen.seeding import Purpose, item_rng

LENGTH = 1000


def test_purposes_are_frozen() -> None:
    assert {purpose.name: purpose.value for purpose in Purpose} == {
        "CAMERA": 0,
        "LIGHTS": 1,
        "OBJECTS": 2,
        "POSES": 3,
        "SELECTION": 4,
    }


def test_streams_are_frozen() -> None:
    """The first numbers of two streams: files made today must be made again tomorrow."""
    first = item_rng(0, 0, Purpose.CAMERA).random()
    other = item_rng(7, 11, Purpose.POSES, 3).integers(2**62)
    key = np.random.SeedSequence(7, spawn_key=(11, 3, 3))
    assert first == np.random.default_rng(np.random.SeedSequence(0, spawn_key=(0, 0, 0))).random()
    assert other == np.random.Generator(np.random.PCG64(key)).integers(2**62)
    assert first == pytest.approx(FIRST_DOUBLE, abs=0)
    assert int(other) == LATER_INTEGER


def test_same_key_gives_the_same_stream() -> None:
    a, b = (item_rng(3, 5, Purpose.LIGHTS, 2).random(LENGTH) for _ in range(2))
    assert a.tobytes() == b.tobytes()


def test_attempt_defaults_to_the_first() -> None:
    with_default = item_rng(3, 5, Purpose.LIGHTS).random(9)
    assert with_default.tobytes() == item_rng(3, 5, Purpose.LIGHTS, 0).random(9).tobytes()


def test_neighbouring_streams_share_no_number() -> None:
    """1,000 doubles of 53 bits each from 120 streams: by chance none would be met twice."""
    keys = list(itertools.product((0, 1, 2, 2**32), (0, 1, 2), (0, 1, 3, 4), (0, 1, 2)))
    streams = [item_rng(s, i, Purpose(p), a).random(LENGTH) for s, i, p, a in keys]
    values, owners = np.unique(np.concatenate(streams), return_inverse=True)
    assert len(values) == len(keys) * LENGTH, "two streams share numbers"
    assert len(owners) == len(values)


def test_neighbouring_streams_are_not_shifted_copies() -> None:
    """`seed + index`, or a counter in place of a key, would make (0, 1) the stream of (1, 0)."""
    assert item_rng(0, 1, Purpose.POSES).random() != item_rng(1, 0, Purpose.POSES).random()
    long = item_rng(0, 0, Purpose.CAMERA).random(20 * LENGTH)
    for key in ((0, 1, 0), (1, 0, 0), (0, 0, 1)):
        start = item_rng(key[0], key[1], Purpose(key[2])).random(LENGTH)
        assert not np.isin(start, long).any()


@pytest.mark.parametrize("key", [(-1, 0, 0), (0, -1, 0), (0, 0, -1)])
def test_negative_keys_are_refused(key: tuple[int, int, int]) -> None:
    with pytest.raises(ValueError, match="non-negative|negative"):
        item_rng(key[0], key[1], Purpose.CAMERA, key[2])
