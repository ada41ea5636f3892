"""Streams of random numbers: frozen, and shared by no two (seed, index, purpose, attempt)."""

import itertools

import numpy as np
import pytest
from scipy.stats import kstest

from scenegen.common.random.seeding import Purpose, item_numbers, item_rng

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


KEYS = list(itertools.product((0, 1, 2**32, 2**63), Purpose, (0, 1, 2**24 - 1), (0, 1000, 2**32)))


def test_numbers_do_not_depend_on_what_else_is_asked_for() -> None:
    index, purpose, attempt, start = map(np.array, zip(*KEYS, strict=True))
    for kind in Purpose:
        some = purpose == kind
        together = item_numbers(5, index[some], kind, attempt[some], start[some], count=7)
        for row, i, a, first in zip(together, index[some], attempt[some], start[some], strict=True):
            assert row.tolist() == item_numbers(5, i, kind, a, first, count=7).tolist()
            assert row[2:5].tolist() == item_numbers(5, i, kind, a, first + 2, count=3).tolist()


def test_no_two_items_share_a_number() -> None:
    """53 random bits each: no two of half a million are alike by chance."""
    seeds = (0, 1, 2**32, 2**63 - 1, 2**63 + 2**31, 2**200)
    found = [item_numbers(s, i, p, a, f, count=100) for s in seeds for i, p, a, f in KEYS]
    assert len(np.unique(np.concatenate(found))) == 100 * len(found)


def test_numbers_are_uniform() -> None:
    found = item_numbers(3, np.arange(500), Purpose.POSES, count=101)
    assert kstest(found.ravel(), "uniform").pvalue > 0.01
    for one, other in ((found[:, :-1], found[:, 1:]), (found[:-1], found[1:])):
        assert abs(np.corrcoef(one.ravel(), other.ravel())[0, 1]) < 4 / one.size**0.5
    assert (found * 2**53 % 1 == 0).all()


def test_numbers_are_frozen() -> None:
    assert item_numbers(7, 11, Purpose.POSES, 3, count=3).tolist() == [
        0.44910493559084974,
        0.9762486799741125,
        0.7089284261583932,
    ]


@pytest.mark.parametrize(
    ("index", "attempt", "start"), [(-1, 0, 0), (0, -1, 0), (0, 2**24, 0), (0, 0, 1), (0, 0, 2**33)]
)
def test_keys_that_the_counter_cannot_hold_are_refused(
    index: int, attempt: int, start: int
) -> None:
    with pytest.raises(ValueError, match="attempts"):
        item_numbers(0, index, Purpose.CAMERA, attempt, start, count=1)
    with pytest.raises(ValueError, match="non-negative"):
        item_numbers(-1, 0, Purpose.CAMERA, count=1)
