"""Tests of the assignment of shape classes to splits."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from iqtt.shapes.catalogue import EXACT_CUBES, _ranks, known_classes, make_catalogue, spread
from iqtt.shapes.polycube import bounding_radius, canonical_class, is_chiral, mirror, set_ids
from iqtt.shapes.sampling import Kind, TooFewShapesError, all_classes, random_shapes


def catalogue_ids(splits: tuple[np.ndarray, ...]) -> list[set[bytes]]:
    return [{bytes(i) for i in set_ids(canonical_class(split))} for split in splits]


@pytest.mark.parametrize(("kind", "cubes"), [("chain", 8), ("tree", 6), ("chain", 13)])
def test_splits_have_their_sizes_and_share_no_class(kind: Kind, cubes: int) -> None:
    sizes = (60, 0, 20, 30)
    catalogue = make_catalogue(np.random.default_rng(0), cubes, sizes, kind)
    ids = catalogue_ids(catalogue.splits)
    assert tuple(len(part) for part in catalogue.splits) == sizes
    assert tuple(len(part) for part in ids) == sizes
    assert all(not a & b for a, b in itertools.combinations(ids, 2))
    for part in catalogue.splits:
        assert (canonical_class(part) == part).all()


@pytest.mark.parametrize("cubes", [8, 13])
def test_every_class_has_one_owner_whatever_its_pose(cubes: int) -> None:
    catalogue = make_catalogue(np.random.default_rng(0), cubes, (60, 20, 30))
    for index, part in enumerate(catalogue.splits):
        assert (catalogue.owner(part) == index).all()
        assert (catalogue.owner(mirror(part)[:, ::-1, [1, 2, 0]] + np.int8(4)) == index).all()
    strangers = random_shapes(np.random.default_rng(5), 500, cubes)
    assert set(catalogue.owner(strangers).tolist()) == {0, 1, 2}


def test_classes_in_no_split_are_owned_in_even_shares() -> None:
    classes = known_classes(9)
    catalogue = make_catalogue(np.random.default_rng(0), 9, (100, 10, 1))
    surplus = np.bincount(catalogue.owner(classes)) - (100, 10, 1)
    assert surplus.sum() == len(classes) - 111
    assert np.ptp(surplus) <= 1


@pytest.mark.parametrize("cubes", [7, 13])
def test_the_seed_decides(cubes: int) -> None:
    first, again, other = (
        make_catalogue(np.random.default_rng(seed), cubes, (40, 40)) for seed in (1, 1, 2)
    )
    probe = random_shapes(np.random.default_rng(0), 50, cubes)
    assert (first.owner(probe) == again.owner(probe)).all()
    assert (first.owner(probe) != other.owner(probe)).any()
    for a, b, c in zip(first.splits, again.splits, other.splits, strict=True):
        assert (a == b).all()
        assert (a != c).any()


def test_classes_come_in_random_order() -> None:
    (part,) = make_catalogue(np.random.default_rng(0), 9, (1000,)).splits
    place = np.searchsorted(set_ids(known_classes(9)), set_ids(part))
    assert abs(np.corrcoef(place, np.arange(1000))[0, 1]) < 0.15
    assert place.min() < 300
    assert place.max() > len(known_classes(9)) - 300


def test_all_classes_there_are_can_be_shared_out() -> None:
    catalogue = make_catalogue(np.random.default_rng(0), 5, (7, 4, 3))
    together = np.concatenate(catalogue.splits)
    assert catalogue_ids((together,)) == catalogue_ids((all_classes(5),))


@pytest.mark.parametrize("cubes", [8, 13])
def test_limits_are_kept(cubes: int) -> None:
    radius = 2.8 if cubes == 8 else 3.2
    catalogue = make_catalogue(
        np.random.default_rng(0), cubes, (50, 20), max_radius=radius, chiral_only=True
    )
    for part in catalogue.splits:
        assert bounding_radius(part).max() <= radius
        assert is_chiral(part).all()


def test_too_many_of_few_shapes_is_refused_with_the_number_there_is() -> None:
    with pytest.raises(TooFewShapesError) as error:
        make_catalogue(np.random.default_rng(0), 5, (10, 3, 2))
    assert str(error.value) == (
        "asked for 15 distinct chain shapes of 5 cubes, mirror images counted as one, but 14 "
        "exist: ask for fewer, take more cubes or loosen the limits"
    )


def test_too_many_drawn_shapes_are_refused_in_bounded_work() -> None:
    with pytest.raises(TooFewShapesError) as error:
        make_catalogue(np.random.default_rng(0), 14, (100,), max_radius=1.2, chiral_only=True)
    assert str(error.value) == (
        "asked for 100 distinct chain shapes of 14 cubes within radius 1.2 that differ from their "
        "mirror image, mirror images counted as one, but 22,800 tries found 0: ask for fewer, "
        "take more cubes or loosen the limits"
    )


def test_requests_without_sense_are_refused() -> None:
    rng = np.random.default_rng(0)
    for sizes in ((), (3, -1)):
        with pytest.raises(ValueError, match="sizes must be one or more counts"):
            make_catalogue(rng, 6, sizes)
    with pytest.raises(ValueError, match="1 to 16 cubes, not 0"):
        make_catalogue(rng, 0, (1,))
    with pytest.raises(ValueError, match="kind is"):
        make_catalogue(rng, 5, (1,), "ring")  # type: ignore[arg-type]
    for kind, most in EXACT_CUBES.items():
        with pytest.raises(ValueError, match=f"more than {most} cubes are not listed"):
            known_classes(most + 1, kind)


def test_listed_classes_cannot_be_changed_by_accident() -> None:
    known_classes(5)[:] = 0
    assert (known_classes(5) == all_classes(5)).all()


def test_ranks_are_those_of_splitmix64_on_the_id() -> None:
    shapes = all_classes(5)
    mask = 2**64 - 1
    for identity, rank in zip(set_ids(shapes), _ranks(shapes, 7), strict=True):
        expected, raw = 7, bytes(identity)
        for i in range(0, 32, 8):
            expected = ((expected ^ int.from_bytes(raw[i : i + 8])) + 0x9E3779B97F4A7C15) & mask
            expected = ((expected ^ expected >> 30) * 0xBF58476D1CE4E5B9) & mask
            expected = ((expected ^ expected >> 27) * 0x94D049BB133111EB) & mask
            expected ^= expected >> 31
        assert int(rank) == expected


@given(st.lists(st.integers(0, 40), min_size=1, max_size=6), st.data())
def test_spread_is_even_where_supplies_allow(supply: list[int], data: st.DataObject) -> None:
    total = data.draw(st.integers(0, sum(supply)))
    counts = spread(total, supply)
    assert sum(counts) == total
    for count, most in zip(counts, supply, strict=True):
        assert 0 <= count <= most
        assert count == most or count >= max(counts) - 1


def test_spreading_more_than_there_is_is_refused() -> None:
    with pytest.raises(TooFewShapesError) as error:
        spread(1000, [14, 47])
    assert str(error.value) == (
        "asked for 1,000 distinct shapes, but 61 exist (14 + 47): "
        "ask for fewer, take more cubes or loosen the limits"
    )
