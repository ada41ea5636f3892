"""Tests of the audit's own names of shapes, and of the numbers that describe them."""

import ast
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from iqtt.audit import shape_proofs, view_proofs
from iqtt.shapes import names as shape_names
from iqtt.shapes.names import cube_codes, name_shapes, whole_turns
from iqtt.shapes.polycube import ROTATIONS, canonical, canonical_class, mirror, set_ids
from iqtt.shapes.sampling import all_classes, random_shapes


def same_partition(a: np.ndarray, b: np.ndarray) -> bool:
    """Whether two lists of names are equal at the same places."""
    pairs = len(np.unique(np.stack([a, b]), axis=1).T)
    return pairs == len(np.unique(a)) == len(np.unique(b))


def numbered(ids: np.ndarray) -> np.ndarray:
    return np.unique(ids, return_inverse=True)[1].reshape(-1)


def test_they_share_nothing_with_the_generator() -> None:
    for module in (shape_names, shape_proofs, view_proofs):
        tree = ast.parse(Path(str(module.__file__)).read_text(encoding="utf-8"))
        imported = {n.module for n in ast.walk(tree) if isinstance(n, ast.ImportFrom)}
        generator = {"polycube", "shapes", "near", "catalogue", "questions", "settle", "views"}
        assert not imported & {f"iqtt.{name}" for name in generator}


def test_the_turns_are_the_rotations_of_the_cube() -> None:
    assert {t.tobytes() for t in whole_turns()} == {r.tobytes() for r in ROTATIONS.astype(int)}


@pytest.mark.parametrize("collide", [False, True])
def test_names_are_those_of_canonical_forms(collide: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    if collide:  # then comparing alone decides
        monkeypatch.setattr(shape_names, "_invariants", lambda cubes: np.zeros(len(cubes)))
    classes = all_classes(5 if collide else 7)
    rng = np.random.default_rng(0)
    shapes = np.concatenate([classes, mirror(classes), classes])
    turns = ROTATIONS[rng.integers(24, size=len(shapes))]
    shapes = np.einsum("sij,snj->sni", turns, shapes) + rng.integers(-9, 9, (len(shapes), 1, 3))
    shapes = shapes[:, rng.permutation(shapes.shape[1])].astype(np.int8)
    names, mirrored = name_shapes(shapes)
    assert same_partition(names, numbered(set_ids(canonical(shapes))))
    assert same_partition(mirrored, numbered(set_ids(canonical_class(shapes))))


@given(st.integers(0, 2**32), st.integers(1, 11))
def test_names_of_random_shapes(seed: int, size: int) -> None:
    rng = np.random.default_rng(seed)
    shapes = random_shapes(rng, 20, size, "tree")
    shapes = np.concatenate([shapes, rng.permutation(mirror(shapes)[:, ::-1] @ ROTATIONS[5].T)])
    names, mirrored = name_shapes(shapes)
    assert same_partition(names, numbered(set_ids(canonical(shapes))))
    assert same_partition(mirrored, numbered(set_ids(canonical_class(shapes))))


def test_no_shapes_have_no_names() -> None:
    names, mirrored = name_shapes(np.zeros((0, 5, 3), np.int8))
    assert len(names) == len(mirrored) == 0
    assert cube_codes(np.zeros((0, 5, 3), np.int8)).shape == (0, 5)
