"""Streams of random numbers: frozen, and shared by no two (seed, index, purpose, attempt)."""

import itertools

import numpy as np
import pytest

from scenegen.common.seeding import Purpose, item_rng

LENGTH = 1000


def test_purposes_are_frozen() -> None:
    """New ones go to the end; this list grows with them and is never edited."""
    names = ["CAMERA", "LIGHTS", "OBJECTS", "POSES", "SELECTION"]
    assert [purpose.name for purpose in Purpose][: len(names)] == names
    assert [purpose.value for purpose in Purpose] == list(range(len(Purpose)))


def test_streams_are_frozen() -> None:
    """Today's files must be made again tomorrow: numbers as the first version drew them."""
    assert item_rng(0, 0, Purpose.CAMERA).random() == 0.6027619159910471
    assert item_rng(7, 11, Purpose.POSES, 3).integers(2**62) == 1234873329320113942


def test_neighbouring_streams_share_no_number() -> None:
    """1,000 doubles a stream: of 53 random bits each, none comes up twice by chance."""
    keys = itertools.product((0, 1, 2, 2**32), (0, 1, 2, 3), Purpose, (0, 1, 2))
    streams = [item_rng(*key).random(LENGTH) for key in keys]
    assert len(np.unique(np.concatenate(streams))) == len(streams) * LENGTH


def test_no_stream_is_a_shifted_copy_of_another() -> None:
    long = item_rng(0, 0, Purpose.CAMERA).random(50 * LENGTH)
    for seed, index, purpose, attempt in ((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1)):
        other = item_rng(seed, index, Purpose(purpose), attempt).random(LENGTH)
        assert not np.isin(other, long).any()


@pytest.mark.parametrize("key", [(-1, 0, 0), (0, -1, 0), (0, 0, -1)])
def test_negative_keys_are_refused(key: tuple[int, int, int]) -> None:
    seed, index, attempt = key
    with pytest.raises(ValueError, match="non-negative"):
        item_rng(seed, index, Purpose.CAMERA, attempt)
