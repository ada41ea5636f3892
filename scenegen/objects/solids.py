"""The type of all shapes, `UnitShape`, and its making from polyhedra and from turned profiles."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from scenegen.common.rotations import cross
from scenegen.objects.basic_hulls import kept
from scenegen.objects.exact_surfaces import Surface, polyhedron_of

if TYPE_CHECKING:
    from scenegen.objects.furniture.shapes import Furnished

Array = NDArray[Any]
SEGMENTS = 512  # around an axis
STRIPS = 16  # along a straight profile; with long slivers rays take three times as long


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles that share vertices.

    Attributes:
        vertices: corners, (V, 3).
        faces: three vertices of each triangle, (F, 3) integers, counter-clockwise seen from
            outside.
        normals: unit normals of the smooth surface at the vertices, (V, 3); None for flat faces.
    """

    vertices: Array
    faces: Array
    normals: Array | None


@dataclass(frozen=True, eq=False)
class UnitShape:
    """A shape of bounding radius 1 about its origin.

    Attributes:
        name: as in `scenes.PlacedObject.shape`.
        make_mesh: returns the mesh; it is called when that is first asked for.
        hull_points, hull_discs, rounding: a convex body that contains the shape, for placement. It
            is the convex hull of horizontal discs with centres (V, 3) and radii (V,), extended by
            the distance `rounding` in all directions.
        resting_directions: unit directions, (S, 3), of the shape's frame that may point down when
            it lies at rest; empty if all may.
        surface: what is rendered instead of the triangles; None if those are rendered.
        coarse: as from `coarse_hulls.coarse_hull`, if it was kept.
        make_colors: returns `colors`; None for a shape without colours of its own.
        furnished: what it is made of as a thing in a closed room; None elsewhere.
    """

    name: str
    make_mesh: Callable[[], Mesh]
    hull_points: Array
    hull_discs: Array
    rounding: float
    resting_directions: Array
    surface: Surface | None = None
    coarse: tuple[Array, float] | None = None
    make_colors: Callable[[], Array] | None = None
    furnished: "Furnished | None" = None

    @cached_property
    def colors(self) -> Array:
        """Own colours at the corners of the faces: linear RGB, 0 to 1, (F, 3, 3); 1 without any."""
        if self.make_colors is None:
            return np.ones((len(self.mesh.faces), 3, 3), np.float32)
        return self.make_colors()

    @cached_property
    def mesh(self) -> Mesh:
        """The triangles and their normals."""
        return self.make_mesh()

    @property
    def triangles(self) -> Array:
        """Corners, (F, 3, 3) float64, counter-clockwise seen from outside."""
        return self.mesh.vertices.astype(np.float64)[self.mesh.faces]

    @property
    def normals(self) -> Array:
        """Unit normals of the surface at those corners, (F, 3, 3)."""
        if self.mesh.normals is not None:
            return np.asarray(self.mesh.normals[self.mesh.faces])
        triangles = self.triangles
        a, b, c = triangles.swapaxes(0, 1)
        normals = np.cross(b - a, c - a)
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        return np.broadcast_to(normals[:, None], triangles.shape)  # one copy for the corners


def outline_of(shape: UnitShape) -> UnitShape:
    """Return what placement reads of a shape, and nothing else.

    The arrays are copies, as views keep alive what they are views of.
    """
    coarse = shape.coarse and (shape.coarse[0].copy(), shape.coarse[1])
    hull = shape.hull_points.copy(), shape.hull_discs.copy()
    resting = shape.resting_directions.copy()
    return UnitShape(shape.name, no_mesh, *hull, shape.rounding, resting, coarse=coarse)


def no_mesh() -> Mesh:
    """Return a mesh without triangles."""
    return Mesh(np.zeros((0, 3)), np.zeros((0, 3), np.int64), None)


def unshared(triangles: Array, normals: Array) -> Mesh:
    """Return triangles and normals, (F, 3, 3) each, as a mesh whose triangles share no vertices."""
    faces = np.arange(3 * len(triangles)).reshape(-1, 3)
    return Mesh(triangles.reshape(-1, 3), faces, normals.reshape(-1, 3))


def polyhedron(name: str, points: Array) -> UnitShape:
    """Return the convex hull of points, (V, 3), with flat faces, centred and scaled to radius 1."""
    points = points - (points.min(0) + points.max(0)) / 2
    points = points / np.linalg.norm(points, axis=1).max()
    planes = kept(f"{name}-planes", lambda: convex_hull(points).equations)
    corners = kept(f"{name}-corners", lambda: convex_hull(points).simplices)
    normals = np.repeat(planes[:, None, :3], 3, axis=1)
    mesh = unshared(*face_outwards(points[corners], normals))
    resting = kept(f"{name}-resting", lambda: resting_directions(points))
    exact = polyhedron_of(planes)
    discs = np.zeros(len(points))
    return UnitShape(name, lambda: mesh, points, discs, 0.0, resting, surface=exact)


def revolution(
    name: str,
    pieces: list[tuple[Array, Array]],
    hull_rings: list[tuple[float, float]],
    rounding: float = 0.0,
    resting: Array | None = None,
    exact: Surface | None = None,
) -> UnitShape:
    """Turn profile pieces about the y axis and scale the result to bounding radius 1.

    Args:
        pieces: (points, normals), both (n, 2) with the columns (radius, height).
        hull_rings: (radius, height) of the discs of the convex body.
        rounding: by which the convex body extends beyond the discs' hull.
        resting: resting directions; by default those of the discs' hull.
        exact: the surface of the scaled shape.
    """
    angle = np.linspace(0, 2 * np.pi, SEGMENTS + 1)

    def turn(values: Array, at: Array) -> Array:
        height = np.broadcast_to(values[:, 1:], (len(values), at.size))
        return np.stack([values[:, :1] * np.cos(at), height, values[:, :1] * np.sin(at)], axis=-1)

    rings = np.array(hull_rings)
    scale = 1 / (np.linalg.norm(rings, axis=1).max() + rounding)

    def mesh() -> Mesh:
        corners, normals = [], []
        for profile, profile_normals in pieces:
            p, n = turn(profile, angle), turn(profile_normals, angle)
            for a, b, c in (((0, 0), (1, 0), (1, 1)), ((0, 0), (1, 1), (0, 1))):
                rows, columns = len(profile) - 1, SEGMENTS
                take = [np.s_[i : i + rows, j : j + columns] for i, j in (a, b, c)]
                corners.append(np.stack([p[t] for t in take], axis=2).reshape(-1, 3, 3))
                normals.append(np.stack([n[t] for t in take], axis=2).reshape(-1, 3, 3))
        outwards = face_outwards(np.concatenate(corners) * scale, np.concatenate(normals))
        return unshared(*outwards)

    if resting is None:
        rims = np.unique(turn(rings, angle[:-1]).reshape(-1, 3), axis=0)
        resting = kept(f"{name}-resting", lambda: resting_directions(rims))
    discs, heights = (rings * scale).T
    hull = np.stack([0 * heights, heights, 0 * heights], axis=1)
    return UnitShape(name, mesh, hull, discs, rounding * scale, resting, exact)


def face_outwards(triangles: Array, normals: Array) -> tuple[Array, Array]:
    """Drop degenerate triangles and wind the others so that they agree with their normals."""
    across = np.array(face_vectors(triangles))
    keep = np.square(across).sum(axis=0) > 1e-24
    triangles, normals, across = triangles[keep], normals[keep], across[:, keep]
    inward = np.einsum("if,fi->f", across, normals[:, 0] + normals[:, 1] + normals[:, 2]) < 0
    triangles[inward] = triangles[inward][:, ::-1]
    normals[inward] = normals[inward][:, ::-1]
    return triangles, normals


def face_vectors(triangles: Array) -> tuple[Array, Array, Array]:
    """Return normals of triangles, (F, 3, 3), by components, as long as twice their areas."""
    first, second = (np.ascontiguousarray((triangles[:, k] - triangles[:, 0]).T) for k in (1, 2))
    return cross(first, second)


def convex_hull(points: Array, options: str | None = None) -> Any:
    """Return Qhull's hull of points, (N, D), a `scipy.spatial.ConvexHull`."""
    from scipy.spatial import ConvexHull  # takes a third of a second, and is seldom needed

    return ConvexHull(points, qhull_options=options)


def resting_directions(points: Array) -> Array:
    """Return outward normals, (S, 3), of the faces of the points' hull on which it can rest.

    It rests on a face if the perpendicular from its centre of mass meets that face.
    """
    hull = convex_hull(points)
    corners, normal = points[hull.simplices], hull.equations[:, :3]
    inside = points.mean(axis=0)
    spokes = corners - inside  # tetrahedra from `inside` to each triangle
    volume = np.abs(np.linalg.det(spokes))
    center = inside + volume @ spokes.sum(axis=1) / (4 * volume.sum())
    foot = center - (normal @ center + hull.equations[:, 3])[:, None] * normal
    edges = np.roll(corners, -1, axis=1) - corners
    sides = np.einsum("fki,fi->fk", np.cross(edges, foot[:, None] - corners), normal)
    stays = (sides > -1e-9).all(axis=1) | (sides < 1e-9).all(axis=1)  # either winding
    return np.asarray(np.unique(np.round(normal[stays], 9), axis=0))


def arc(
    center: tuple[float, float], radius: float, low: float, high: float, segments: int
) -> tuple[Array, Array]:
    """Return profile and normals of an arc, angles in degrees from the radial direction."""
    angle = np.radians(np.linspace(low, high, segments + 1))
    normals = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    normals[np.abs(normals) < 1e-15] = 0.0
    return np.array(center) + radius * normals, normals


def line(start: tuple[float, float], end: tuple[float, float]) -> tuple[Array, Array]:
    """Return profile and normals of a straight piece whose outside is on its right."""
    along = np.subtract(end, start)
    normal = np.array([along[1], -along[0]]) / np.linalg.norm(along)
    fraction = np.linspace(0.0, 1.0, STRIPS + 1)[:, None]
    return start + fraction * along, np.repeat(normal[None], STRIPS + 1, axis=0)
