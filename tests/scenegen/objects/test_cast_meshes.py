"""Shapes as they are rendered: triangles, grown for trees alone, and normals."""

import numpy as np

from scenegen.objects.cast_meshes import OVERLAP, cast_mesh, overlapping
from scenegen.objects.catalogue import built_in_shape
from scenegen.objects.solids import Mesh


def test_meshes_are_cast_in_single_precision():
    shape = built_in_shape("mug/0001")
    mesh = cast_mesh(shape.mesh)
    assert (mesh.vertices.dtype, mesh.faces.dtype) == (np.float32, np.uint16)
    np.testing.assert_array_equal(mesh.vertices[mesh.faces], np.float32(shape.triangles))
    np.testing.assert_array_equal(mesh.normals[mesh.faces], np.float32(shape.normals))
    flat = cast_mesh(Mesh(np.zeros((2**16 + 1, 3)), np.array([[0, 1, 2**16]]), None))
    assert flat.normals is None
    assert flat.faces.tolist() == [[0, 1, 2**16]]


def test_degenerate_triangles_stay_finite():
    point, line = np.ones((1, 3, 3)), np.arange(9.0).reshape(1, 3, 3)
    for triangle in (point, line):
        grown = overlapping(triangle)
        assert np.isfinite(grown).all()
        assert np.linalg.norm(grown - triangle, axis=2).max() <= 4.0001 * OVERLAP
