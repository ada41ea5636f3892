"""Exact surfaces against the meshes of their shapes."""

import numpy as np
import pytest

from scenegen.objects.basic_shapes import unit_shape
from scenegen.objects.exact_surfaces import FAR, Polyhedron, cone_of, polyhedron_of

SLABS = {"box": 3, "pyramid": 5, "prism": 4, "tetrahedron": 4, "octahedron": 4}
SLABS |= {"dodecahedron": 6, "icosahedron": 10}


@pytest.mark.parametrize("name", SLABS)
def test_polyhedra_have_each_face_once_and_opposite_ones_together(name):
    shape = unit_shape(name)
    assert isinstance(shape.surface, Polyhedron)
    slabs = shape.surface.slabs
    assert slabs.shape == (SLABS[name], 5)
    np.testing.assert_allclose(np.linalg.norm(slabs[:, :3], axis=1), 1, atol=1e-12)
    at = shape.triangles.reshape(-1, 3) @ slabs[:, :3].T
    np.testing.assert_allclose(at.max(axis=0), slabs[:, 4], atol=1e-12)
    closed = slabs[:, 3] > -FAR
    np.testing.assert_allclose(at.min(axis=0)[closed], slabs[closed, 3], atol=1e-12)


def test_planes_of_a_slab_may_be_given_twice():
    planes = np.array([[0, 1, 0, -0.5], [0, 1, 0, -0.5], [0, -1, 0, -0.25], [1, 0, 0, -1]])
    expected = [[0, 1, 0, -0.25, 0.5], [1, 0, 0, -FAR, 1]]
    np.testing.assert_array_equal(polyhedron_of(planes).slabs, expected)


def test_a_cone_narrows_to_its_tip():
    cone = cone_of(-0.5, 0.7, 0.9)
    for y, radius in ((-0.5, 0.9), (0.1, 0.45), (0.7, 0.0)):
        assert cone.a + cone.b * y + cone.c * y * y == pytest.approx(radius**2, abs=1e-12)
