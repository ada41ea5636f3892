"""Planes and objects of a scene as triangle meshes, for export and for other ray casters."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import trimesh
from numpy.typing import NDArray

from scenegen.common.rotations import rotation_matrix
from scenegen.description.scenes import SceneSpec
from scenegen.objects.basic_shapes import unit_shape
from scenegen.objects.furniture.room_shell import shell
from scenegen.objects.solids import UnitShape


@dataclass(frozen=True, eq=False)
class ScenePart:
    """A plane of the room, or an object, in the world frame.

    Attributes:
        object_id: 0 for the room, k for the k-th object.
        normals: unit normals at the corners of the mesh's faces, (F, 3, 3).
    """

    name: str
    object_id: int
    mesh: trimesh.Trimesh
    normals: NDArray[np.float64]


def welded(shape: UnitShape) -> trimesh.Trimesh:
    """Return a unit shape as a mesh whose triangles share vertices."""
    corners = shape.triangles.reshape(-1, 3)
    mesh = trimesh.Trimesh(corners, np.arange(len(corners)).reshape(-1, 3), process=False)
    mesh.merge_vertices()
    return mesh


def scene_parts(
    scene: SceneSpec, shape_of: Callable[[str], UnitShape] = unit_shape
) -> list[ScenePart]:
    """Return the planes of the room, if there is one, and the objects of a scene."""
    parts = [] if scene.room_reflectance is None else _room(scene)
    for k, item in enumerate(scene.objects, start=1):
        shape = shape_of(item.shape)
        mesh = welded(shape)
        mesh.apply_transform(world_from_object(item.position, item.rotation, item.scale))
        normals = shape.normals @ rotation_matrix(item.rotation).T
        parts.append(ScenePart(f"object_{k}_{item.shape}", k, mesh, normals))
    return parts


def _room(scene: SceneSpec) -> list[ScenePart]:
    if scene.interior is None:
        return _planes()
    found = shell(scene.interior)
    faces = np.arange(3 * len(found.corners)).reshape(-1, 3)
    mesh = trimesh.Trimesh(found.corners.reshape(-1, 3), faces, process=False)
    return [ScenePart("room", 0, mesh, np.repeat(found.normals[:, None], 3, axis=1))]


def room_mesh() -> trimesh.Trimesh:
    """Return the floor y = 0 and the walls x = 0 and z = 0 of the unit box, facing inwards."""
    return trimesh.util.concatenate([plane.mesh for plane in _planes()])


def _planes() -> list[ScenePart]:
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    floor = np.array([[0, 0, 0], [0, 0, 1], [1, 0, 1], [1, 0, 0]], float)
    planes = []
    for name, axis in (("floor", 1), ("wall_x", 0), ("wall_z", 2)):
        corners = np.roll(floor, axis - 1, axis=1)  # a cyclic permutation keeps the winding
        mesh = trimesh.Trimesh(corners, faces, process=False)
        planes.append(ScenePart(name, 0, mesh, np.broadcast_to(np.eye(3)[axis], (2, 3, 3))))
    return planes


def world_from_object(
    position: tuple[float, float, float], rotation: tuple[float, float, float, float], scale: float
) -> NDArray[np.float64]:
    """Return the matrix, (4, 4), that maps a unit shape to its place in the world."""
    matrix = np.eye(4)
    matrix[:3, :3] = scale * rotation_matrix(rotation)
    matrix[:3, 3] = position
    return matrix
