"""Random shapes and the lists of all shapes, against published counts."""

import numpy as np
import pytest
from polycubes import some_shapes

from iqtt.shapes import chains_and_trees
from iqtt.shapes.chains_and_trees import all_classes, all_walks, random_shapes
from iqtt.shapes.polycube import canonical_class, is_chiral, set_ids, symmetries

# Self-avoiding walks of 1, 2, ... steps on the cubic lattice, OEIS A001412.
WALKS = [6, 30, 150, 726, 3534, 16926, 81390, 387966, 1853886]
# Polycubes of 1, 2, ... cubes: in fixed orientation (A001931), modulo rotations (A000162), and
# modulo rotations and mirrors (A038119).
FIXED = [1, 3, 15, 86, 534, 3481, 23502, 162913]
ONE_SIDED = [1, 1, 2, 8, 29, 166, 1023, 6922]
TWO_SIDED = [1, 1, 2, 7, 23, 112, 607, 3811]
KINDS = pytest.mark.parametrize("kind", ["chain", "tree"])


@pytest.mark.parametrize(("steps", "count"), list(enumerate(WALKS, start=1)))
def test_as_many_walks_as_published(steps, count):
    walks = all_walks(steps + 1)
    axes_used = (np.ptp(walks, axis=1) > 0).sum(axis=1)
    assert np.array([0, 6, 24, 48])[axes_used].sum() == count


@pytest.mark.parametrize("cubes", range(1, 9))
def test_as_many_polycubes_as_published(cubes):
    classes = all_classes(cubes, "tree")
    hands = 1 + is_chiral(classes)
    assert len(classes) == TWO_SIDED[cubes - 1]
    assert hands.sum() == ONE_SIDED[cubes - 1]
    assert (hands * 24 // symmetries(classes).sum(axis=1)).sum() == FIXED[cubes - 1]


@KINDS
def test_all_classes_are_canonical_and_in_the_order_of_their_ids(kind):
    classes = all_classes(6, kind)
    assert (canonical_class(classes) == classes).all()
    ids = set_ids(classes).tolist()
    assert ids == sorted(set(ids))


@KINDS
@pytest.mark.parametrize("cubes", [1, 2, 5, 16])
def test_random_shapes_are_connected_and_do_not_overlap(kind, cubes):
    first, found, other = (
        some_shapes(np.random.default_rng(seed), 300, cubes, kind) for seed in (0, 0, 1)
    )
    assert (first == found).all()
    assert (first != other).any() == (cubes > 1)
    assert (found.shape, found.dtype) == ((300, cubes, 3), np.int8)
    assert (found[:, 0] == 0).all()
    apart = np.abs(found[:, :, None].astype(int) - found[:, None]).sum(axis=3)
    assert ((apart == 0).sum(axis=(1, 2)) == cubes).all()
    for i in range(1, cubes):
        earlier = apart[:, i, i - 1 : i] if kind == "chain" else apart[:, i, :i]
        assert (earlier == 1).any(axis=1).all()


def test_random_chains_are_uniform_over_walks():
    # Five cubes: the shortest walks of which some meet themselves. 6 * 5**3 walks of four steps
    # never turn straight back; 726 of those avoid themselves, and only they are kept.
    walks = random_shapes(np.random.default_rng(0), 75_000, 5)
    share = 726 / 750
    assert abs(len(walks) - 75_000 * share) < 5 * np.sqrt(75_000 * share * (1 - share))
    _, counts = np.unique(walks.reshape(len(walks), -1), axis=0, return_counts=True)
    assert len(counts) == 726
    chi_squared = ((counts - counts.mean()) ** 2 / counts.mean()).sum()
    assert abs(chi_squared - 725) < 5 * np.sqrt(2 * 725)


def test_trees_grow_on_every_free_face_alike():
    # A domino shows ten faces, two of which make a rod of three.
    found = random_shapes(np.random.default_rng(0), 50_000, 3, "tree")
    rods = (np.ptp(found, axis=1) == 2).any(axis=1).sum()
    assert abs(rods - 10_000) < 5 * np.sqrt(50_000 * 0.2 * 0.8)


def test_a_request_that_no_shape_meets_is_refused():
    rng = np.random.default_rng(0)
    for cubes in (0, 17):
        for call in (lambda: random_shapes(rng, 1, cubes), lambda: all_classes(cubes, "tree")):
            with pytest.raises(ValueError, match="16 cubes"):
                call()
    with pytest.raises(ValueError, match="ring"):
        random_shapes(rng, 1, 5, "ring")  # type: ignore[arg-type]
    assert random_shapes(rng, 0, 4).shape == (0, 4, 3)


def test_growing_by_parts_changes_nothing(monkeypatch):
    whole = all_classes(6, "tree")
    monkeypatch.setattr(chains_and_trees, "MAX_GROWN", 90)
    assert (all_classes(6, "tree") == whole).all()
