"""Tests of ids and sizes of polycubes, and of what is refused."""

import itertools

import numpy as np
import pytest
from numpy.typing import NDArray

from iqtt.shapes.polycube import (
    MAX_CUBES,
    bounding_radius,
    box_centre,
    canonical,
    canonical_class,
    is_chiral,
    set_ids,
    symmetries,
)
from iqtt.shapes.sampling import random_shapes

ROD = np.array([[[0, 0, 0], [1, 0, 0], [2, 0, 0]]])


def test_ids_are_the_sorted_cubes_themselves() -> None:
    shape = np.array([[[4, 9, 7], [3, 8, 5]]])
    (bytes_,) = set_ids(shape).view(np.uint8).reshape(-1, 32)
    assert bytes_.tolist() == [0x00, 0x00, 0x01, 0x12] + [0xFF] * 28


def test_ids_tell_sets_apart_but_not_places_and_orders() -> None:
    chain = random_shapes(np.random.default_rng(0), 3000, 5)
    ids = set_ids(chain)
    sets = [frozenset(map(tuple, (c - c.min(axis=0)).tolist())) for c in chain]
    assert len(set(ids.tolist())) == len(set(sets))
    assert (set_ids(chain[:, ::-1] + np.int8(3)) == ids).all()


def test_ids_of_unlike_sizes_differ() -> None:
    chain = random_shapes(np.random.default_rng(0), 1, 10)
    parts = [chain[:, :n] for n in range(1, 11)]
    ids = np.concatenate([set_ids(part) for part in parts])
    assert len(np.unique(ids)) == 10


def test_radius_of_known_shapes() -> None:
    assert bounding_radius(np.array([[[7, 7, 7]]])) == pytest.approx(np.sqrt(3) / 2)
    assert bounding_radius(ROD) == pytest.approx(np.sqrt(1.5**2 + 0.5))
    assert box_centre(ROD).tolist() == [[1.5, 0.5, 0.5]]


@pytest.mark.parametrize("cubes", [1, 2, 5, 16])
def test_the_radius_reaches_the_farthest_corner(cubes: int) -> None:
    unit = np.array(list(itertools.product((0, 1), repeat=3)))
    for shape in random_shapes(np.random.default_rng(cubes), 50, cubes):
        corners = (shape[:, None] + unit).reshape(-1, 3)
        centre = (corners.min(axis=0) + corners.max(axis=0)) / 2
        assert box_centre(shape[None])[0] == pytest.approx(centre)
        farthest = np.linalg.norm(corners - centre, axis=1).max()
        assert bounding_radius(shape[None])[0] == pytest.approx(farthest)


def test_no_shapes_are_no_trouble() -> None:
    nothing = np.zeros((0, 4, 3), dtype=np.int8)
    assert canonical(nothing).shape == canonical_class(nothing).shape == (0, 4, 3)
    assert set_ids(nothing).shape == is_chiral(nothing).shape == (0,)
    assert symmetries(nothing).shape == (0, 24)
    assert bounding_radius(nothing).shape == (0,)


@pytest.mark.parametrize(
    ("cubes", "message"),
    [
        (np.zeros((2, 3), np.int8), r"shape \(S, n, 3\)"),
        (np.zeros((2, 3, 4), np.int8), r"shape \(S, n, 3\)"),
        (np.zeros((2, 3, 3)), "signed integers"),
        (np.zeros((2, 3, 3), np.uint8), "signed integers"),
        (np.zeros((2, 0, 3), np.int8), "1 to 16 cubes, not 0"),
        (np.zeros((2, 17, 3), np.int8), "1 to 16 cubes, not 17"),
        (np.array([[[0, 0, 0]] * 2, [[0, 0, 0], [0, 16, 0]]]), "shape 1 spans more than 16"),
        (np.array([[[-(2**63), 0, 0], [2**63 - 1, 0, 0]]]), "shape 0 spans more than 16"),
    ],
)
def test_what_cannot_be_shapes_is_refused(cubes: NDArray[np.int64], message: str) -> None:
    for function in (canonical, canonical_class, set_ids, is_chiral, symmetries):
        with pytest.raises(ValueError, match=message):
            function(cubes)


def test_the_longest_shape_is_accepted() -> None:
    rod = np.zeros((1, MAX_CUBES, 3), dtype=np.int8)
    rod[0, :, 2] = np.arange(MAX_CUBES)
    assert canonical(rod)[0, :, 0].tolist() == list(range(MAX_CUBES))
