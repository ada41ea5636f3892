"""A whole scene, room and objects, as one triangle mesh: for export and for other ray casters."""

from collections.abc import Callable

import numpy as np
import trimesh
from numpy.typing import NDArray

from scenegen.common.rotations import rotation_matrix
from scenegen.description.scenes import SceneSpec
from scenegen.objects.basic_shapes import unit_shape
from scenegen.objects.solids import UnitShape


def welded(shape: UnitShape) -> trimesh.Trimesh:
    """Return a unit shape as a mesh whose triangles share vertices."""
    corners = shape.triangles.reshape(-1, 3)
    mesh = trimesh.Trimesh(corners, np.arange(len(corners)).reshape(-1, 3), process=False)
    mesh.merge_vertices()
    return mesh


def scene_mesh(
    scene: SceneSpec, shape_of: Callable[[str], UnitShape] = unit_shape
) -> trimesh.Trimesh:
    """Return the room and the objects of a scene as one mesh in the world frame."""
    parts = [] if scene.room_reflectance is None else [room_mesh()]
    for item in scene.objects:
        mesh = welded(shape_of(item.shape))
        mesh.apply_transform(world_from_object(item.position, item.rotation, item.scale))
        parts.append(mesh)
    return trimesh.util.concatenate(parts)


def room_mesh() -> trimesh.Trimesh:
    """Return the floor y = 0 and the walls x = 0 and z = 0 of the unit box, facing inwards."""
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    floor = np.array([[0, 0, 0], [0, 0, 1], [1, 0, 1], [1, 0, 0]], float)
    # Cyclic permutations of the axes keep the winding.
    planes = [np.roll(floor, shift, axis=1) for shift in (0, 2, 1)]
    return trimesh.util.concatenate([trimesh.Trimesh(p, faces, process=False) for p in planes])


def world_from_object(
    position: tuple[float, float, float], rotation: tuple[float, float, float, float], scale: float
) -> NDArray[np.float64]:
    """Return the matrix, (4, 4), that maps a unit shape to its place in the world."""
    matrix = np.eye(4)
    matrix[:3, :3] = scale * rotation_matrix(rotation)
    matrix[:3, 3] = position
    return matrix
