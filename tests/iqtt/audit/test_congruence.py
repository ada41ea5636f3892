"""The audit's own judgement of which shapes are the same, against the generator's."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from polycubes import are_congruent, some_shapes

from iqtt.audit import congruence
from iqtt.audit.congruence import congruent_rows, name_shapes
from iqtt.shapes.chains_and_trees import all_classes
from iqtt.shapes.polycube import ROTATIONS, canonical, canonical_class, is_chiral, mirror, set_ids


@given(st.integers(0, 2**32), st.integers(1, 12), st.sampled_from(["chain", "tree"]))
def test_turned_and_moved_copies_are_congruent(seed, size, kind):
    rng = np.random.default_rng(seed)
    shapes = some_shapes(rng, 24, size, kind)
    copies = np.einsum("qij,qnj->qni", ROTATIONS, shapes)[:, rng.permutation(size)]
    assert congruent_rows(shapes, copies + rng.integers(-9, 9, size=(24, 1, 3))).all()


@pytest.mark.parametrize("kind", ["chain", "tree"])
@pytest.mark.parametrize("cubes", [4, 5, 6])
def test_canonical_form_and_brute_force_agree_on_all_pairs(kind, cubes):
    classes = all_classes(cubes, kind)
    both = np.concatenate([classes, mirror(classes)])
    a, b = (both[index.ravel()] for index in np.indices((len(both), len(both))))
    same_form = (canonical(a) == canonical(b)).all(axis=(1, 2))
    assert (congruent_rows(a, b) == same_form).all()
    assert same_form.sum() == len(both) + 2 * (~is_chiral(classes)).sum()


def test_small_types_do_not_overflow():
    rod = np.array([[0, 0, 100], [0, 0, 101]], dtype=np.int8)
    assert are_congruent(rod, np.array([[0, -128, 0], [0, -127, 0]], dtype=np.int8))
    far = np.array([[-128, 0, 0], [127, 0, 0]], dtype=np.int8)
    assert not are_congruent(rod, far)  # 255 apart, which is -1 in int8
    assert are_congruent(far, np.array([[0, 0, 0], [0, 255, 0]], dtype=np.uint8))


@pytest.mark.parametrize(
    ("cubes", "message"),
    [
        (np.zeros((0, 3), np.int8), "n >= 1"),
        (np.zeros((2, 4), np.int8), r"shape \(Q, n, 3\)"),
        (np.zeros((2, 3)), "integers"),
        (np.array([[0, 0, 0], [1, 0, 0], [0, 0, 0]]), "shape 4321"),
        (np.array([[0, 0, 0], [1001, 0, 0]]), "shape 4321"),
        (np.array([[0, 0, 0], [-(2**63), 0, 0]]), "shape 4321"),
        (np.array([[0, 0, 0], [2**64 - 1, 0, 0]], dtype=np.uint64), "shape 4321"),
    ],
)
def test_what_cannot_be_shapes_is_refused_and_its_row_named(cubes, message):
    rod = np.zeros(cubes.shape, cubes.dtype)
    rod[:, 0] = np.arange(len(cubes))
    shapes = np.tile(rod, (5000, 1, 1))
    shapes[4321] = cubes
    with pytest.raises(ValueError, match=message):
        congruent_rows(shapes, shapes)


def same_partition(a, b):
    """Whether two lists of names are equal at the same places."""
    pairs = len(np.unique(np.stack([a, b]), axis=1).T)
    return pairs == len(np.unique(a)) == len(np.unique(b))


def numbered(ids):
    return np.unique(ids, return_inverse=True)[1].reshape(-1)


def test_comparing_decides_where_invariants_collide(monkeypatch):
    monkeypatch.setattr(congruence, "shape_invariants", lambda cubes: np.zeros(len(cubes)))
    monkeypatch.setattr(congruence, "_CHUNK", 7)
    classes = all_classes(5)
    rng = np.random.default_rng(0)
    shapes = np.concatenate([classes, mirror(classes), classes])
    turns = ROTATIONS[rng.integers(24, size=len(shapes))]
    shapes = np.einsum("sij,snj->sni", turns, shapes) + rng.integers(-9, 9, (len(shapes), 1, 3))
    shapes = shapes[:, rng.permutation(shapes.shape[1])].astype(np.int8)
    names, mirrored = name_shapes(shapes)
    assert same_partition(names, numbered(set_ids(canonical(shapes))))
    assert same_partition(mirrored, numbered(set_ids(canonical_class(shapes))))


@given(st.integers(0, 2**32), st.integers(1, 11))
def test_names_of_some_shapes(seed, size):
    rng = np.random.default_rng(seed)
    shapes = some_shapes(rng, 20, size, "tree")
    shapes = np.concatenate([shapes, rng.permutation(mirror(shapes)[:, ::-1] @ ROTATIONS[5].T)])
    names, mirrored = name_shapes(shapes)
    assert same_partition(names, numbered(set_ids(canonical(shapes))))
    assert same_partition(mirrored, numbered(set_ids(canonical_class(shapes))))
