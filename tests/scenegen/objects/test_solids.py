"""Profiles, winding, hulls and resting directions of bodies with known answers."""

import numpy as np
import pytest

from scenegen.objects.solids import (
    arc,
    face_outwards,
    line,
    resting_directions,
    revolution,
)

CUBE = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)


def leaning_prism(lean: float) -> np.ndarray:
    """A unit square base, two high; the top is moved sideways by `lean`."""
    return CUBE * (1, 2, 1) + np.outer(CUBE[:, 1], [lean, 0, 0])


@pytest.mark.parametrize(("lean", "stays"), [(0.0, True), (0.9, True), (1.1, False)])
def test_a_prism_falls_over_once_its_middle_leaves_its_base(lean: float, stays: bool) -> None:
    """The centre of mass stands `lean` / 2 off the base's centre, 1/2 from its edge."""
    found = resting_directions(leaning_prism(lean))
    assert (found == [0, -1, 0]).all(axis=1).any() == stays


def test_rest_is_about_the_centre_of_mass_not_of_the_corners() -> None:
    """Many corners at one end move their mean but not the centre of mass."""
    crowd = np.array([(0.5 + 1e-3 * np.cos(a), 2.0, 0.5 + 1e-3 * np.sin(a)) for a in range(60)])
    crowd += [1.1, 0, 0]
    body = np.concatenate([CUBE, crowd])  # a cube under a thin leaning spire
    assert (resting_directions(body) == [0, -1, 0]).all(axis=1).any()
    assert abs(body.mean(axis=0)[0] - 0.5) > 0.5, "the corners' mean is off the base"


def test_each_side_is_listed_once_although_hulls_are_triangulated() -> None:
    found = resting_directions(CUBE)
    assert sorted(map(tuple, found.tolist())) == sorted(
        map(tuple, np.concatenate([np.eye(3), -np.eye(3)]).tolist())
    )


def test_winding_is_turned_with_its_normals_and_slivers_are_dropped() -> None:
    up = np.tile([0.0, 0.0, 1.0], (3, 1))
    counter_clockwise = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0)], float)
    sliver = np.array([(0, 0, 0), (1, 0, 0), (1, 0, 0)], float)
    tagged = up + np.outer([0, 1, 2], [0.01, 0, 0])
    triangles, normals = face_outwards(
        np.stack([counter_clockwise, counter_clockwise[::-1], sliver]),
        np.stack([tagged, tagged[::-1], up]),
    )
    assert len(triangles) == 2
    for corners, corner_normals in zip(triangles, normals, strict=True):
        np.testing.assert_array_equal(corners, counter_clockwise)
        np.testing.assert_array_equal(corner_normals, tagged)


def test_a_turned_rectangle_is_a_cylinder() -> None:
    """Radius 3 and half height 4, so bounding radius 5 before scaling."""
    pieces = [line((0, -4), (3, -4)), line((3, -4), (3, 4)), line((3, 4), (0, 4))]
    shape = revolution("drum", pieces, [(3, -4), (3, 4)])
    radius = np.hypot(shape.triangles[..., 0], shape.triangles[..., 2])
    assert radius.max() == pytest.approx(0.6)
    assert abs(shape.triangles[..., 1]).max() == pytest.approx(0.8)
    slanted = np.array([[0.6, 0.8, 0.0], [0.0, -0.8, 0.6], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    np.testing.assert_allclose(shape.support(slanted), [1.0, 1.0, 0.6, 0.8], atol=1e-12)
    upright = shape.resting_directions[abs(shape.resting_directions[:, 1]) > 0.5]
    np.testing.assert_allclose(np.sort(upright[:, 1]), [-1.0, 1.0])


def test_support_of_a_grown_disc() -> None:
    """A torus lies in its disc grown by a ball: 2/3 + 1/3 along the disc, 1/3 across."""
    sides = np.array([[0.0, 1.0, 0.0]])
    shape = revolution("ring", [arc((2.0, 0.0), 1.0, 0, 360, 8)], [(2, 0)], 1.0, sides)
    np.testing.assert_array_equal(shape.resting_directions, sides)
    np.testing.assert_allclose(shape.support(np.eye(3)), [1.0, 1 / 3, 1.0], atol=1e-12)
    slanted = np.array([[0.6, 0.8, 0.0]])
    np.testing.assert_allclose(shape.support(slanted), 2 / 3 * 0.6 + 1 / 3, atol=1e-12)
