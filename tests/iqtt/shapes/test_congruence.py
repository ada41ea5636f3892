"""Tests of the independent congruence check, and of the generator's against it."""

import ast
import itertools
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from iqtt.shapes import congruence
from iqtt.shapes.congruence import are_congruent, congruent_rows
from iqtt.shapes.polycube import ROTATIONS, canonical, is_chiral, mirror
from iqtt.shapes.sampling import Kind, all_classes, random_shapes

TWIST = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [1, 1, 1]])
OTHER_TWIST = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [1, 1, -1]])
ELL = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [2, 1, 0]])


def test_it_shares_nothing_with_the_generator() -> None:
    tree = ast.parse(Path(congruence.__file__).read_text(encoding="utf-8"))
    imported = {
        name.name if isinstance(node, ast.Import) else node.module
        for node in ast.walk(tree)
        if isinstance(node, ast.Import | ast.ImportFrom)
        for name in node.names
    }
    assert imported == {"itertools", "typing", "numpy", "numpy.typing"}


def test_known_pairs() -> None:
    assert are_congruent(TWIST, TWIST)
    assert are_congruent(
        ELL, ELL[::-1] * np.array([1, -1, 1]) + np.array([3, -20, 5])
    )  # flat: a mirror is a turn
    assert not are_congruent(TWIST, OTHER_TWIST)
    assert not are_congruent(TWIST, ELL)
    assert not are_congruent(TWIST, TWIST[:3])


def test_each_turn_is_needed() -> None:
    arm = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [2, 1, 0], [2, 1, 1]])
    for signs in itertools.product((1, -1), repeat=3):
        for axes in itertools.permutations(range(3)):
            moved = arm[:, axes] * np.array(signs)
            even = list(axes) in ([0, 1, 2], [1, 2, 0], [2, 0, 1])
            assert are_congruent(arm, moved) == (even == (np.prod(signs) == 1))


def test_shapes_with_the_same_distances_are_told_apart() -> None:
    # The quick filter cannot tell mirror images, so all the work is left to the rotations.
    chiral = all_classes(6)
    chiral = chiral[is_chiral(chiral)]
    assert not congruent_rows(chiral, mirror(chiral)).any()


@given(st.integers(0, 2**32), st.integers(1, 12), st.sampled_from(["chain", "tree"]))
def test_turned_and_moved_copies_are_congruent(seed: int, size: int, kind: Kind) -> None:
    rng = np.random.default_rng(seed)
    shapes = random_shapes(rng, 24, size, kind)
    copies = np.einsum("qij,qnj->qni", ROTATIONS, shapes)[:, rng.permutation(size)]
    assert congruent_rows(shapes, copies + rng.integers(-9, 9, size=(24, 1, 3))).all()


@pytest.mark.parametrize("kind", ["chain", "tree"])
@pytest.mark.parametrize("cubes", [4, 5, 6])
def test_canonical_form_and_brute_force_agree_on_all_pairs(kind: Kind, cubes: int) -> None:
    classes = all_classes(cubes, kind)
    both = np.concatenate([classes, mirror(classes)])
    a, b = (both[index.ravel()] for index in np.indices((len(both), len(both))))
    same_form = (canonical(a) == canonical(b)).all(axis=(1, 2))
    assert (congruent_rows(a, b) == same_form).all()
    assert same_form.sum() == len(both) + 2 * (~is_chiral(classes)).sum()


def test_rows_beyond_one_chunk_are_judged_alike() -> None:
    rng = np.random.default_rng(0)
    a, b = random_shapes(rng, 9000, 4), random_shapes(rng, 9000, 4)
    same_form = (canonical(a) == canonical(b)).all(axis=(1, 2))
    assert (congruent_rows(a, b) == same_form).all()
    assert 0 < same_form.sum() < 9000


def test_small_types_do_not_overflow() -> None:
    rod = np.array([[0, 0, 100], [0, 0, 101]], dtype=np.int8)
    assert are_congruent(rod, np.array([[0, -128, 0], [0, -127, 0]], dtype=np.int8))
    far = np.array([[-128, 0, 0], [127, 0, 0]], dtype=np.int8)
    assert not are_congruent(rod, far)  # 255 apart, which is -1 in int8
    assert are_congruent(far, np.array([[0, 0, 0], [0, 255, 0]], dtype=np.uint8))


def test_no_rows_are_no_trouble() -> None:
    nothing = np.zeros((0, 5, 3), dtype=np.int8)
    assert congruent_rows(nothing, nothing).shape == (0,)


@pytest.mark.parametrize(
    ("cubes", "message"),
    [
        (np.zeros((0, 3), np.int8), "n >= 1"),
        (np.zeros((2, 4), np.int8), r"shape \(Q, n, 3\)"),
        (np.zeros((2, 3)), "must be integers"),
        (np.array([[0, 0, 0], [1, 0, 0], [0, 0, 0]]), "shape 0 names a cube twice"),
        (np.array([[0, 0, 0], [1001, 0, 0]]), "shape 0 has a coordinate beyond"),
        (np.array([[0, 0, 0], [-(2**63), 0, 0]]), "shape 0 has a coordinate beyond"),
        (np.array([[0, 0, 0], [2**64 - 1, 0, 0]], dtype=np.uint64), "shape 0 has a coordinate"),
    ],
)
def test_what_cannot_be_shapes_is_refused(cubes: np.ndarray, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        are_congruent(cubes, cubes)


def test_the_refused_row_is_named() -> None:
    shapes = np.tile(ELL, (5000, 1, 1))
    shapes[4321, 1] = shapes[4321, 0]
    with pytest.raises(ValueError, match="shape 4321 names a cube twice"):
        congruent_rows(shapes, shapes)
    shapes[4321, 1] = 3000
    with pytest.raises(ValueError, match="shape 4321 has a coordinate"):
        congruent_rows(shapes, shapes)


def test_unlike_arrays_cannot_be_paired() -> None:
    with pytest.raises(ValueError, match="cannot pair"):
        congruent_rows(np.tile(ELL, (2, 1, 1)), np.tile(ELL, (3, 1, 1)))
