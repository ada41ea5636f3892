"""Answers: meshes are compared under rotations, never reflections; submissions are valid."""

import numpy as np
from scipy.spatial.transform import Rotation

from baselines.rezende.answers import mesh_distance
from baselines.rezende.network import icosphere


def chiral():
    """Return a mesh that is no rotation of its mirror image: three arms of different lengths."""
    sphere, _ = icosphere(2)
    arms = zip(np.eye(3), (0.8, 1.6, 2.4))
    length = 1 + sum(reach * (sphere @ axis).clip(0) ** 6 for axis, reach in arms)
    return (0.7 * sphere * length[:, None]).astype(np.float32)


def test_a_turned_and_moved_mesh_is_nearer_than_its_mirror_image_or_another():
    mesh = chiral()
    wide = mesh * np.float32([1.6, 1, 1])
    for turn in Rotation.random(5, random_state=1).as_matrix().astype(np.float32):
        same = mesh_distance(mesh, mesh @ turn.T + np.float32([3, -1, 2]))
        mirrored = mesh_distance(mesh, (mesh * np.float32([-1, 1, 1])) @ turn.T)
        assert 0 <= same < 0.5 * min(mirrored, mesh_distance(mesh, wide @ turn.T))
