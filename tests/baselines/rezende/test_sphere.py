"""The icosphere is a closed sphere of known size, and smoothing keeps what is constant."""

import numpy as np
import pytest

from baselines.rezende.sphere import icosphere


@pytest.mark.parametrize(("cuts", "corners", "triangles"), [(0, 12, 20), (2, 162, 320)])
def test_an_icosphere_is_a_closed_mesh_that_faces_outwards(cuts, corners, triangles):
    vertices, faces = icosphere(cuts)
    assert vertices.shape == (corners, 3)
    assert faces.shape == (triangles, 3)
    np.testing.assert_allclose(np.linalg.norm(vertices, axis=1), 1, atol=1e-12)
    edges = {(a, b) for face in faces.tolist() for a, b in zip(face, face[1:] + face[:1])}
    assert edges == {(b, a) for a, b in edges}  # each edge once in each direction
    assert len(edges) == 3 * triangles
    volume = np.linalg.det(vertices[faces]).sum() / 6
    assert 2.5 < volume < 4 * np.pi / 3
    assert (np.linalg.det(vertices[faces]) > 0).all()
