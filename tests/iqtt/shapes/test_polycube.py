"""Rotations, canonical form, chirality, symmetries, ids and sizes of shapes; what is refused."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from polycubes import some_shapes

from iqtt.shapes.polycube import (
    MAX_CUBES,
    ROTATIONS,
    bounding_radius,
    box_centre,
    canonical,
    canonical_class,
    is_chiral,
    mirror,
    set_ids,
    symmetries,
)

ROD = [[0, 0, 0], [1, 0, 0], [2, 0, 0]]
CORNER = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
SQUARE = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]
TRIPOD = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
TWIST = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [1, 1, 1]]
BLOCK = list(itertools.product((0, 1), repeat=3))
# Ten cubes with three right-angled bends, the form of Shepard & Metzler's own objects.
BENT_ARM = (
    [[0, 0, z] for z in (2, 1, 0)]
    + [[x, 0, 0] for x in (1, 2, 3)]
    + [[3, y, 0] for y in (1, 2)]
    + [[x, 2, 0] for x in (4, 5)]
)


def one(cubes):
    return np.array(cubes, dtype=np.int8)[None]


@st.composite
def shapes(draw):
    """One random shape of 1 to 16 cubes, (1, n, 3)."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    kind = draw(st.sampled_from(("chain", "tree")))
    return some_shapes(rng, 1, draw(st.integers(1, MAX_CUBES)), kind)


@st.composite
def shapes_and_copies(draw):
    """A shape, and the same one turned, moved and with its cubes in another order."""
    shape = draw(shapes())
    turn = ROTATIONS[draw(st.integers(0, 23))]
    shift = np.array(draw(st.tuples(*[st.integers(-50, 50)] * 3)), dtype=np.int8)
    order = draw(st.permutations(range(shape.shape[1])))
    return shape, ((shape @ turn.T) + shift)[:, order]


def test_the_rotations_are_a_group_of_24():
    members = {rotation.tobytes() for rotation in ROTATIONS}
    assert len(ROTATIONS) == len(members) == 24
    assert (ROTATIONS[0] == np.eye(3)).all()
    for a in ROTATIONS:
        assert round(np.linalg.det(a)) == 1
        assert a.T.tobytes() in members
        assert (a @ a.T == np.eye(3)).all()
        assert all((a @ b).tobytes() in members for b in ROTATIONS)


@given(shapes_and_copies())
def test_copies_have_one_canonical_form(pair):
    shape, copy = pair
    assert (canonical(shape) == canonical(copy)).all()
    assert (canonical_class(shape) == canonical_class(copy)).all()
    assert (canonical_class(shape) == canonical_class(mirror(copy))).all()
    assert is_chiral(shape) == is_chiral(copy)
    assert symmetries(shape).sum() == symmetries(copy).sum()
    assert bounding_radius(shape) == bounding_radius(copy)


@given(shapes())
def test_canonical_forms_are_idempotent_sorted_and_at_the_origin(shape):
    for form in (canonical, canonical_class):
        result = form(shape)
        assert result.dtype == np.int8
        assert (form(result) == result).all()
        assert (result.min(axis=1) == 0).all()
        assert result[0].tolist() == sorted(result[0].tolist())


@given(shapes())
def test_the_canonical_form_is_a_turned_copy(shape):
    target = {tuple(cube) for cube in canonical(shape)[0].tolist()}
    turned = [shape[0] @ rotation.T for rotation in ROTATIONS]
    assert any({tuple(c) for c in (t - t.min(axis=0)).tolist()} == target for t in turned)


def test_many_shapes_at_once_give_what_each_gives_alone():
    many = some_shapes(np.random.default_rng(0), 20_000, 6)  # more than one chunk
    together = canonical(many)
    for row in (0, 8191, 8192, 19_999):
        assert (together[row] == canonical(many[row : row + 1])[0]).all()


@pytest.mark.parametrize(
    ("cubes", "count", "chiral"),
    [
        ([[0, 0, 0]], 24, False), (BLOCK, 24, False), (ROD, 8, False), (SQUARE, 8, False),
        (TRIPOD, 3, False), (CORNER, 2, False), (TWIST, 2, True), (BENT_ARM, 1, True),
    ],
)  # fmt: skip
def test_symmetries_and_chirality_of_known_shapes(cubes, count, chiral):
    shape = one(cubes)
    assert is_chiral(shape) == is_chiral(mirror(shape)) == [chiral]
    assert (set_ids(canonical(shape)) != set_ids(canonical(mirror(shape)))) == [chiral]
    mask = symmetries(shape)
    assert mask.shape == (1, 24)
    assert mask.sum() == count
    own = {tuple(cube) for cube in shape[0].tolist()}
    for rotation, keeps in zip(ROTATIONS, mask[0], strict=True):
        turned = shape[0] @ rotation.T
        turned = turned - turned.min(axis=0) + shape[0].min(axis=0)
        assert ({tuple(cube) for cube in turned.tolist()} == own) == keeps


def test_ids_are_the_sorted_cubes_themselves():
    shape = np.array([[[4, 9, 7], [3, 8, 5]]])
    (bytes_,) = set_ids(shape).view(np.uint8).reshape(-1, 32)
    assert bytes_.tolist() == [0x00, 0x00, 0x01, 0x12] + [0xFF] * 28


def test_ids_tell_sets_apart_but_not_places_and_orders():
    chain = some_shapes(np.random.default_rng(0), 3000, 5)
    ids = set_ids(chain)
    sets = [frozenset(map(tuple, (c - c.min(axis=0)).tolist())) for c in chain]
    assert len(set(ids.tolist())) == len(set(sets))
    assert (set_ids(chain[:, ::-1] + np.int8(3)) == ids).all()
    sizes = [set_ids(chain[:1, :n]) for n in range(1, 6)]
    assert len(np.unique(np.concatenate(sizes))) == 5, "ids of other numbers of cubes differ"


@pytest.mark.parametrize("cubes", [1, 2, 5, 16])
def test_the_radius_reaches_the_farthest_corner(cubes):
    unit = np.array(list(itertools.product((0, 1), repeat=3)))
    for shape in some_shapes(np.random.default_rng(cubes), 50, cubes):
        corners = (shape[:, None] + unit).reshape(-1, 3)
        centre = (corners.min(axis=0) + corners.max(axis=0)) / 2
        assert box_centre(shape[None])[0] == pytest.approx(centre)
        farthest = np.linalg.norm(corners - centre, axis=1).max()
        assert bounding_radius(shape[None])[0] == pytest.approx(farthest)
