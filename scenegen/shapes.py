"""Basic shapes and the room shell as geometry. Every unit shape has bounding radius 1 about 0.

Curved shapes other than the sphere are fine triangle meshes with the exact normals of the smooth
surface at their corners; the mesh is the ground truth, and stays within `SAGITTA` of the smooth
surface. The sphere is rendered as the exact quadric; its mesh is for export.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from scenegen import teapot
from scenegen.errors import SpecError
from scenegen.specs import SceneSpec

Array = NDArray[Any]
SEGMENTS = 512  # around an axis
STRIPS = 16  # along a straight profile: long slivers would make rays three times as expensive
SAGITTA = 1.9e-5  # 1 - cos(pi / SEGMENTS): the most a unit mesh lies inside its smooth surface


@dataclass(frozen=True, eq=False)
class UnitShape:
    """A shape of bounding radius 1 about its origin.

    Attributes:
        name: as in `specs.SHAPE_NAMES`.
        triangles: corners, (F, 3, 3), counter-clockwise seen from outside.
        normals: unit normals at those corners, (F, 3, 3).
        hull_points, hull_discs, rounding: a convex body that contains the shape, for placement:
            the hull of horizontal discs about the points (V, 3) with radii (V,), grown by a ball.
        resting_directions: unit directions, (S, 3), each of which may point down when the shape
            lies still; empty where all may.
        is_sphere: whether it is rendered as the exact unit sphere.
    """

    name: str
    triangles: Array
    normals: Array
    hull_points: Array
    hull_discs: Array
    rounding: float
    resting_directions: Array
    is_sphere: bool = False

    def support(self, directions: Array) -> Array:
        """Return how far the convex body reaches along unit directions: (M, 3) -> (M,)."""
        reach = self.hull_points @ directions.T
        reach += self.hull_discs[:, None] * np.hypot(directions[:, 0], directions[:, 2])
        return np.asarray(reach.max(axis=0) + self.rounding)


@lru_cache(maxsize=None)
def unit_shape(name: str) -> UnitShape:
    """Return the unit shape of that name. Raises SpecError for an unknown one."""
    if name not in _BUILDERS:
        raise SpecError(f"shape: found {name!r}, expected one of {', '.join(_BUILDERS)}")
    return _BUILDERS[name]()


def unit_mesh(name: str) -> trimesh.Trimesh:
    """Return the unit shape as a welded mesh."""
    triangles = unit_shape(name).triangles
    mesh = trimesh.Trimesh(
        triangles.reshape(-1, 3), np.arange(triangles.size // 3).reshape(-1, 3), process=False
    )
    mesh.merge_vertices()
    return mesh


def scene_mesh(scene: SceneSpec) -> trimesh.Trimesh:
    """Return room and objects as one mesh in world coordinates, for export and for other engines."""
    parts = [room_mesh()]
    for item in scene.objects:
        mesh = unit_mesh(item.shape)
        mesh.apply_transform(world_from_object(item.position, item.rotation, item.scale))
        parts.append(mesh)
    return trimesh.util.concatenate(parts)


def room_mesh() -> trimesh.Trimesh:
    """Return the floor y = 0 and the walls x = 0 and z = 0 of the unit box, facing inwards."""
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    floor = np.array([[0, 0, 0], [0, 0, 1], [1, 0, 1], [1, 0, 0]], float)
    planes = [floor, floor[:, [1, 2, 0]], floor[:, [2, 0, 1]]]  # turning the axes keeps the winding
    return trimesh.util.concatenate([trimesh.Trimesh(p, faces, process=False) for p in planes])


def rotation_matrix(quaternion: tuple[float, float, float, float]) -> NDArray[np.float64]:
    """Return the (3, 3) rotation of a unit quaternion (w, x, y, z)."""
    w, x, y, z = quaternion
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


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


def _polyhedron(name: str, points: Array) -> UnitShape:
    points = points - (points.min(0) + points.max(0)) / 2
    points = points / np.linalg.norm(points, axis=1).max()
    hull = ConvexHull(points)
    triangles = points[hull.simplices]
    normals = np.repeat(hull.equations[:, None, :3], 3, axis=1)
    triangles, normals = _face_outwards(triangles, normals)
    resting = _resting_directions(points)
    return UnitShape(name, triangles, normals, points, np.zeros(len(points)), 0.0, resting)


def _revolution(
    name: str,
    pieces: list[tuple[Array, Array]],
    hull_rings: list[tuple[float, float]],
    rounding: float = 0.0,
    resting: Array | None = None,
    is_sphere: bool = False,
) -> UnitShape:
    """Turn profile pieces, each (radius, height) points and normals of shape (n, 2), about y.

    The result is scaled by the largest distance from the origin, rounding included.
    """
    angle = np.linspace(0, 2 * np.pi, SEGMENTS + 1)

    def turn(values: Array, at: Array) -> Array:
        radius, height = values[:, None, 0], np.broadcast_to(values[:, None, 1], (len(values), at.size))
        return np.stack([radius * np.cos(at), height, radius * np.sin(at)], axis=-1)

    corners, normals = [], []
    for profile, profile_normals in pieces:
        p, n = turn(profile, angle), turn(profile_normals, angle)
        for a, b, c in (((0, 0), (1, 0), (1, 1)), ((0, 0), (1, 1), (0, 1))):
            rows, columns = len(profile) - 1, SEGMENTS
            take = [np.s_[i : i + rows, j : j + columns] for i, j in (a, b, c)]
            corners.append(np.stack([p[t] for t in take], axis=2).reshape(-1, 3, 3))
            normals.append(np.stack([n[t] for t in take], axis=2).reshape(-1, 3, 3))
    rings = np.array(hull_rings)
    scale = 1 / (np.linalg.norm(rings, axis=1).max() + rounding)
    triangles, corner_normals = _face_outwards(
        np.concatenate(corners) * scale, np.concatenate(normals)
    )
    if resting is None:
        resting = _resting_directions(np.unique(turn(rings, angle[:-1]).reshape(-1, 3), axis=0))
    discs, heights = (rings * scale).T
    hull = np.stack([0 * heights, heights, 0 * heights], axis=1)
    return UnitShape(
        name, triangles, corner_normals, hull, discs, rounding * scale, resting, is_sphere
    )


def _face_outwards(triangles: Array, normals: Array) -> tuple[Array, Array]:
    """Drop degenerate triangles and wind the others so that they agree with their normals."""
    cross = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    keep = np.linalg.norm(cross, axis=1) > 1e-12
    triangles, normals, cross = triangles[keep], normals[keep], cross[keep]
    inward = np.einsum("fi,fi->f", cross, normals.sum(1)) < 0
    triangles[inward] = triangles[inward][:, ::-1]
    normals[inward] = normals[inward][:, ::-1]
    return triangles, normals


def _resting_directions(points: Array) -> Array:
    """Outward normals of the hull's faces on which the body stays when put down.

    It stays where the plumb line from its centre of mass meets the face that it stands on.
    """
    hull = ConvexHull(points)
    corners, normal = points[hull.simplices], hull.equations[:, :3]
    inside = points.mean(axis=0)
    spokes = corners - inside  # tetrahedra from `inside` to each triangle
    volume = np.abs(np.linalg.det(spokes))
    center = inside + volume @ spokes.sum(axis=1) / (4 * volume.sum())
    foot = center - (normal @ center + hull.equations[:, 3])[:, None] * normal
    edges = np.roll(corners, -1, axis=1) - corners
    sides = np.einsum("fki,fi->fk", np.cross(edges, foot[:, None] - corners), normal)
    stays = (sides > -1e-9).all(axis=1) | (sides < 1e-9).all(axis=1)  # whichever way it is wound
    return np.asarray(np.unique(np.round(normal[stays], 9), axis=0))


def _arc(
    center: tuple[float, float], radius: float, low: float, high: float, segments: int
) -> tuple[Array, Array]:
    """Profile and normals of an arc, angles in degrees from the radial direction."""
    angle = np.radians(np.linspace(low, high, segments + 1))
    normals = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    normals[np.abs(normals) < 1e-15] = 0.0
    return np.array(center) + radius * normals, normals


def _line(start: tuple[float, float], end: tuple[float, float]) -> tuple[Array, Array]:
    """Profile and normals of a straight piece whose outside is on its right."""
    along = np.subtract(end, start)
    normal = np.array([along[1], -along[0]]) / np.linalg.norm(along)
    fraction = np.linspace(0.0, 1.0, STRIPS + 1)[:, None]
    return start + fraction * along, np.repeat(normal[None], STRIPS + 1, axis=0)


def _box() -> UnitShape:
    return _polyhedron("box", np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1]), float).reshape(3, -1).T)


def _sphere() -> UnitShape:
    anywhere = np.empty((0, 3))
    return _revolution("sphere", [_arc((0, 0), 1, -90, 90, 256)], [(0, 0)], 1.0, anywhere, is_sphere=True)


def _cone() -> UnitShape:
    return _revolution("cone", [_line((0, -1), (1, -1)), _line((1, -1), (0, 1))], [(1, -1), (0, 1)])


def _cylinder() -> UnitShape:
    pieces = [_line((0, -1), (0.8, -1)), _line((0.8, -1), (0.8, 1)), _line((0.8, 1), (0, 1))]
    return _revolution("cylinder", pieces, [(0.8, -1), (0.8, 1)])


def _torus() -> UnitShape:
    flat = np.array([[0.0, -1.0, 0.0], [0.0, 1.0, 0.0]])
    return _revolution("torus", [_arc((0.68, 0), 0.32, 0, 360, 256)], [(0.68, 0)], 0.32, flat)


def _capsule() -> UnitShape:
    angle = np.linspace(0, 2 * np.pi, 256, endpoint=False)
    lying = np.stack([np.cos(angle), np.zeros(256), np.sin(angle)], axis=1)
    pieces = [_arc((0, -0.5), 0.5, -90, 0, 96), _line((0.5, -0.5), (0.5, 0.5)), _arc((0, 0.5), 0.5, 0, 90, 96)]
    return _revolution("capsule", pieces, [(0, -0.5), (0, 0.5)], 0.5, lying)


def _pyramid() -> UnitShape:
    base = [(x, -0.7, z) for x in (-1, 1) for z in (-1, 1)]
    return _polyhedron("pyramid", np.array([*base, (0, 0.7, 0)], float))


def _prism() -> UnitShape:
    angle = np.radians([90, 210, 330])
    ends = [(np.cos(a), y, np.sin(a)) for a in angle for y in (-0.9, 0.9)]
    return _polyhedron("prism", np.array(ends))


def _tetrahedron() -> UnitShape:
    return _polyhedron("tetrahedron", np.array([(1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)], float))


def _octahedron() -> UnitShape:
    return _polyhedron("octahedron", np.concatenate([np.eye(3), -np.eye(3)]))


def _icosahedron() -> UnitShape:
    return _polyhedron("icosahedron", _golden_points())


def _dodecahedron() -> UnitShape:
    hull = ConvexHull(_golden_points())
    return _polyhedron("dodecahedron", _golden_points()[hull.simplices].mean(axis=1))


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
    resting = _resting_directions(points[on_hull])

    corners = (corners - center) * scale
    triangles = np.concatenate([corners[:, [0, 1, 2]], corners[:, [0, 2, 3]]])
    corner_normals = np.concatenate([normals[:, [0, 1, 2]], normals[:, [0, 2, 3]]])
    triangles, corner_normals = _face_outwards(triangles, corner_normals)
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
