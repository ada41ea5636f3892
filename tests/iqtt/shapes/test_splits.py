"""The assignment of shape classes to splits: disjoint, fair, and decided by the seed."""

import itertools

import numpy as np
import pytest
from polycubes import some_shapes

from iqtt.shapes.chains_and_trees import Kind, all_classes
from iqtt.shapes.polycube import bounding_radius, canonical_class, set_ids
from iqtt.shapes.splits import LISTED_CUBES, TooFewShapesError, assign_classes, known_classes


def ids_of(shapes: np.ndarray) -> set[bytes]:
    return {bytes(i) for i in set_ids(canonical_class(shapes))}


@pytest.mark.parametrize(("kind", "cubes"), [("chain", 8), ("tree", 6), ("chain", 13)])
def test_splits_have_their_sizes_share_no_class_and_own_theirs(kind: Kind, cubes: int) -> None:
    sizes = (60, 0, 20, 30)
    assigned = assign_classes(np.random.default_rng(0), cubes, sizes, kind)
    ids = [ids_of(part) for part in assigned.splits]
    assert tuple(map(len, assigned.splits)) == tuple(map(len, ids)) == sizes
    assert all(not a & b for a, b in itertools.combinations(ids, 2))
    for index, part in enumerate(assigned.splits):
        assert (canonical_class(part) == part).all()
        assert (assigned.owner(part) == index).all()
    strangers = canonical_class(some_shapes(np.random.default_rng(5), 500, cubes, kind))
    assert set(assigned.owner(strangers).tolist()) <= {0, 1, 2, 3}


def test_classes_in_no_split_are_owned_in_even_shares() -> None:
    classes = known_classes(9)
    assigned = assign_classes(np.random.default_rng(0), 9, (100, 10, 1))
    surplus = np.bincount(assigned.owner(classes)) - (100, 10, 1)
    assert surplus.sum() == len(classes) - 111
    assert np.ptp(surplus) <= 1


@pytest.mark.parametrize("cubes", [7, 13])
def test_the_seed_decides(cubes: int) -> None:
    first, again, other = (
        assign_classes(np.random.default_rng(seed), cubes, (40, 40)) for seed in (1, 1, 2)
    )
    probe = canonical_class(some_shapes(np.random.default_rng(0), 50, cubes))
    assert (first.owner(probe) == again.owner(probe)).all()
    assert (first.owner(probe) != other.owner(probe)).any()
    for a, b, c in zip(first.splits, again.splits, other.splits, strict=True):
        assert (a == b).all()
        assert (a != c).any()


def test_all_classes_there_are_can_be_shared_out() -> None:
    assigned = assign_classes(np.random.default_rng(0), 5, (7, 4, 3))
    assert ids_of(np.concatenate(assigned.splits)) == ids_of(all_classes(5))


@pytest.mark.parametrize(("cubes", "radius"), [(8, 2.8), (13, 3.2)])
def test_the_radius_is_kept(cubes: int, radius: float) -> None:
    assigned = assign_classes(np.random.default_rng(0), cubes, (50, 20), max_radius=radius)
    assert max(bounding_radius(part).max() for part in assigned.splits) <= radius
    rod = np.array([[[0, 0, 0], [1, 0, 0]]], np.int8)
    assert len(known_classes(2, max_radius=float(bounding_radius(rod)[0]))) == 1, "met exactly"


@pytest.mark.parametrize(
    ("cubes", "sizes", "radius", "found"),
    [(5, (10, 3, 2), np.inf, "14"), (14, (100,), 1.2, "0 in 22,800 tries")],
)
def test_too_many_of_few_shapes_are_refused_in_bounded_work(
    cubes: int, sizes: tuple[int, ...], radius: float, found: str
) -> None:
    with pytest.raises(TooFewShapesError) as error:
        assign_classes(np.random.default_rng(0), cubes, sizes, max_radius=radius)
    assert (error.value.found, error.value.expected) == (found, str(sum(sizes)))


def test_requests_without_sense_are_refused() -> None:
    rng = np.random.default_rng(0)
    for cubes, sizes, kind in ((6, (), "chain"), (6, (3, -1), "chain"), (0, (1,), "chain"),
                               (5, (1,), "ring")):  # fmt: skip
        with pytest.raises(ValueError, match=r"sizes|cubes|kind"):
            assign_classes(rng, cubes, sizes, kind)  # type: ignore[arg-type]
    for listed, most in LISTED_CUBES.items():
        with pytest.raises(ValueError, match="not listed"):
            known_classes(most + 1, listed)


def test_listed_classes_cannot_be_changed_by_accident() -> None:
    known_classes(5)[:] = 0
    assert (known_classes(5) == all_classes(5)).all()


def test_the_order_of_classes_is_that_of_splitmix64_on_salt_and_id() -> None:
    """Reckoned in Python's integers, so that no machine orders them otherwise."""
    mask, salt = 2**64 - 1, int(np.random.default_rng(7).integers(2**63))

    def rank(identity: bytes) -> int:
        mixed = salt
        for i in range(0, 32, 8):
            mixed = ((mixed ^ int.from_bytes(identity[i : i + 8])) + 0x9E3779B97F4A7C15) & mask
            mixed = ((mixed ^ mixed >> 30) * 0xBF58476D1CE4E5B9) & mask
            mixed = ((mixed ^ mixed >> 27) * 0x94D049BB133111EB) & mask
            mixed ^= mixed >> 31
        return mixed

    (part,) = assign_classes(np.random.default_rng(7), 5, (14,)).splits
    ranks = [rank(bytes(identity)) for identity in set_ids(part)]
    assert ranks == sorted(ranks)
