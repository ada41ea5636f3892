"""Basic shapes and the room shell as geometry. Every unit shape has bounding radius 1 about 0.

Curved shapes other than the sphere are fine triangle meshes with the exact normals of the smooth
surface at their corners. The mesh is the ground truth; it lies within 4.5e-5 of the smooth surface,
the teapot's within 6.5e-4 of Newell's patches. The sphere is rendered as the exact quadric; its
mesh is for export.
"""

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from scenegen.common.errors import SpecError
from scenegen.common.rotations import rotation_matrix
from scenegen.description.scenes import SceneSpec
from scenegen.objects import teapot
from scenegen.objects.solids import (
    UnitShape,
    arc,
    face_outwards,
    line,
    polyhedron,
    resting_directions,
    revolution,
)

Array = NDArray[Any]


@cache
def unit_shape(name: str) -> UnitShape:
    """Return the unit shape of that name. Raises SpecError for an unknown one."""
    if name not in _BUILDERS:
        raise SpecError(f"shape: found {name!r}, expected one of {', '.join(_BUILDERS)}")
    return _BUILDERS[name]()


def welded(shape: UnitShape) -> trimesh.Trimesh:
    """Return a unit shape as a mesh whose triangles share corners."""
    triangles = shape.triangles
    mesh = trimesh.Trimesh(
        triangles.reshape(-1, 3), np.arange(triangles.size // 3).reshape(-1, 3), process=False
    )
    mesh.merge_vertices()
    return mesh


def scene_mesh(
    scene: SceneSpec, shape_of: Callable[[str], UnitShape] = unit_shape
) -> trimesh.Trimesh:
    """Return room and objects as one mesh, world frame, for export and for other engines."""
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
    planes = [floor, floor[:, [1, 2, 0]], floor[:, [2, 0, 1]]]  # turning the axes keeps the winding
    return trimesh.util.concatenate([trimesh.Trimesh(p, faces, process=False) for p in planes])


def world_from_object(
    position: tuple[float, float, float],
    rotation: tuple[float, float, float, float],
    scale: float,
) -> NDArray[np.float64]:
    """Return the (4, 4) similarity of a placed object."""
    matrix = np.eye(4)
    matrix[:3, :3] = scale * rotation_matrix(rotation)
    matrix[:3, 3] = position
    return matrix


def _box() -> UnitShape:
    return polyhedron(
        "box", np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1]), float).reshape(3, -1).T
    )


def _sphere() -> UnitShape:
    anywhere = np.empty((0, 3))
    return revolution(
        "sphere", [arc((0, 0), 1, -90, 90, 256)], [(0, 0)], 1.0, anywhere, is_sphere=True
    )


def _cone() -> UnitShape:
    return revolution("cone", [line((0, -1), (1, -1)), line((1, -1), (0, 1))], [(1, -1), (0, 1)])


def _cylinder() -> UnitShape:
    pieces = [line((0, -1), (0.8, -1)), line((0.8, -1), (0.8, 1)), line((0.8, 1), (0, 1))]
    return revolution("cylinder", pieces, [(0.8, -1), (0.8, 1)])


def _torus() -> UnitShape:
    flat = np.array([[0.0, -1.0, 0.0], [0.0, 1.0, 0.0]])
    return revolution("torus", [arc((0.68, 0), 0.32, 0, 360, 256)], [(0.68, 0)], 0.32, flat)


def _capsule() -> UnitShape:
    angle = np.linspace(0, 2 * np.pi, 256, endpoint=False)
    lying = np.stack([np.cos(angle), np.zeros(256), np.sin(angle)], axis=1)
    pieces = [
        arc((0, -0.5), 0.5, -90, 0, 96),
        line((0.5, -0.5), (0.5, 0.5)),
        arc((0, 0.5), 0.5, 0, 90, 96),
    ]
    return revolution("capsule", pieces, [(0, -0.5), (0, 0.5)], 0.5, lying)


def _pyramid() -> UnitShape:
    base = [(x, -0.7, z) for x in (-1, 1) for z in (-1, 1)]
    return polyhedron("pyramid", np.array([*base, (0, 0.7, 0)], float))


def _prism() -> UnitShape:
    angle = np.radians([90, 210, 330])
    ends = [(np.cos(a), y, np.sin(a)) for a in angle for y in (-0.9, 0.9)]
    return polyhedron("prism", np.array(ends))


def _tetrahedron() -> UnitShape:
    return polyhedron(
        "tetrahedron", np.array([(1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)], float)
    )


def _octahedron() -> UnitShape:
    return polyhedron("octahedron", np.concatenate([np.eye(3), -np.eye(3)]))


def _icosahedron() -> UnitShape:
    return polyhedron("icosahedron", _golden_points())


def _dodecahedron() -> UnitShape:
    hull = ConvexHull(_golden_points())
    return polyhedron("dodecahedron", _golden_points()[hull.simplices].mean(axis=1))


def _golden_points() -> Array:
    """Vertices of an icosahedron: the cyclic permutations of (0, +-1, +-golden ratio)."""
    golden = (1 + 5**0.5) / 2
    first = np.array([(0, s, t * golden) for s in (-1, 1) for t in (-1, 1)])
    return np.concatenate([np.roll(first, k, axis=1) for k in range(3)])


def _teapot() -> UnitShape:
    corners, normals = teapot.tessellate(divisions=32)
    center = (corners.min((0, 1)) + corners.max((0, 1))) / 2
    scale = 1 / np.linalg.norm(corners - center, axis=-1).max()
    # For placement: the turned parts as discs, which may stick out a hair, the others as points.
    points = corners.reshape(-1, 3)
    on_hull = ConvexHull(points).vertices
    turned_points = 4 * teapot.turned_quads(divisions=32)
    turned = points[on_hull[on_hull < turned_points]]
    others = points[on_hull[on_hull >= turned_points]]
    profile = np.stack([np.hypot(turned[:, 0], turned[:, 2]), turned[:, 1]], axis=1)
    discs, heights = profile[ConvexHull(profile).vertices].T
    axis_points = np.stack([0 * heights, heights, 0 * heights], axis=1)
    hull = (np.concatenate([axis_points, others]) - center) * scale
    discs = np.concatenate([discs, np.zeros(len(others))]) * scale
    resting = resting_directions(points[on_hull])

    corners = (corners - center) * scale
    triangles = np.concatenate([corners[:, [0, 1, 2]], corners[:, [0, 2, 3]]])
    corner_normals = np.concatenate([normals[:, [0, 1, 2]], normals[:, [0, 2, 3]]])
    triangles, corner_normals = face_outwards(triangles, corner_normals)
    return UnitShape("teapot", triangles, corner_normals, hull, discs, 0.0, resting)


_BUILDERS: dict[str, Callable[[], UnitShape]] = {
    "box": _box,
    "sphere": _sphere,
    "cone": _cone,
    "torus": _torus,
    "cylinder": _cylinder,
    "teapot": _teapot,
    "capsule": _capsule,
    "pyramid": _pyramid,
    "prism": _prism,
    "tetrahedron": _tetrahedron,
    "octahedron": _octahedron,
    "dodecahedron": _dodecahedron,
    "icosahedron": _icosahedron,
}
