"""Closed parts with exact normals, lofted from rounded rectangles (of which circles are a case).

Every part comes with a convex body that contains it, as the hull of horizontal discs; see
`UnitShape`. Frame: y up.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from scenegen.objects.families.parts.profiles import Curve, Point, hull_rows
from scenegen.objects.solids import Array

SEGMENTS = 40  # around an axis; a multiple of 4


@dataclass(frozen=True, eq=False)
class Part:
    """A closed surface, wound counter-clockwise seen from outside.

    Attributes:
        vertices: corners, all used, (V, 3).
        faces: three vertices of each triangle, (F, 3).
        normals: unit normals of the smooth surface at the vertices, (V, 3).
        hull_points, hull_discs: centres (V, 3) and radii (V,) of horizontal discs whose convex
            hull contains the part.
        pieces: into how many blocks of equal length, each a closed surface, vertices and faces
            divide.
        sheet: where the vertices lie on a cloth that is wound about the part: how far around, how
            far along, and the whole way around, (V, 3); None, or 0 all around, where it is flat.
        material: what the part is made of, or its role, from which that follows (`furnishing`).
    """

    vertices: Array
    faces: Array
    normals: Array
    hull_points: Array
    hull_discs: Array
    pieces: int = 1
    sheet: Array | None = None
    material: str = ""


def made_of(material: str, *parts: Part) -> list[Part]:
    """Return parts that are made of this material; those that have one keep it."""
    return [part if part.material else replace(part, material=material) for part in parts]


def loft(
    profile: Curve,
    *,
    size: Point = (1.0, 1.0),
    corner: float = 1.0,
    base: tuple[float, float, float] = (0.0, 0.0, 0.0),
    at: Point | Sequence[Point] = (0.0, 0.0),
    lean: Point | Sequence[Point] | Array = (0.0, 0.0),
    segments: int = SEGMENTS,
    closed: bool = False,
) -> Part:
    """Stack horizontal rounded rectangles along a profile (r, y), with flat lids at open ends.

    At (r, y) the half sizes are base[:2] + size * r, and the radius of the corners is
    base[2] + corner * r, which must be between 0 and the half sizes. With the defaults the result
    is a surface of revolution.

    Args:
        at, lean: the centre (x, z) at y = 0, and how far it moves per unit of y. Several values of
            either, or as many of both, make copies within the same part.
        closed: whether the profile ends where it begins (a ring), and so needs no lids.
    """
    rate = np.array([*size, corner])
    points, tangents = profile
    sizes = np.array(base) + points[:, :1] * rate  # half x, half z, corner radius: (m, 3)
    rows = np.concatenate([sizes, points[:, 1:], tangents[:, :1] * rate, tangents[:, 1:]], axis=1)
    is_round = base == (0.0, 0.0, 0.0) and size == (corner, corner)
    centers, leans = np.broadcast_arrays(np.array(at, ndmin=2), np.array(lean, ndmin=2))

    both_sides = np.concatenate([points, points * (-1.0, 1.0)])
    discs = rows[[i for i in hull_rows(both_sides) if i < len(points)]]
    inner = np.abs(discs[:, :2] - discs[:, 2:3]).max(axis=0) > 1e-12  # one, two or four discs a row
    signs = np.array(
        [(x, z) for x in (1.0, -1.0)[: 1 + inner[0]] for z in (1.0, -1.0)[: 1 + inner[1]]]
    )
    hull = np.empty((len(centers), len(discs), len(signs), 3))
    hull[..., ::2] = (centers[:, None] + leans[:, None] * discs[:, 3:4])[:, :, None]
    hull[..., ::2] += signs * (discs[:, :2] - discs[:, 2:3])[:, None]
    hull[..., 1] = discs[:, 3:4]
    radii = np.broadcast_to(discs[:, 2:3], hull.shape[:-1])

    if not closed:
        rows = _with_lids(rows)
    sizes, y, growth, rise = rows[:, :3], rows[:, 3:4], rows[:, 4:7], rows[:, 7:8]
    outward, quadrant = outline(segments, is_round)
    grid = np.empty((len(centers), len(rows), len(outward), 3))  # copies, rows, around, xyz
    normals = np.empty(grid.shape)
    grid[..., ::2] = (centers[:, None] + leans[:, None] * y)[:, :, None]
    grid[..., ::2] += section(sizes, outward, quadrant)
    grid[..., 1] = y
    normals[..., ::2] = outward * rise[:, None]
    normals[..., 1] = -(section(growth, outward, quadrant) * outward).sum(axis=-1)
    normals[..., 1] -= (leans[:, None] * outward).sum(axis=-1)[:, None] * rise
    vertices, faces, units, sheet = strips(grid, normals)
    sheet[np.abs(units[:, 1]) > 0.7, 2] = 0.0  # a lid or a flat top is not wound about the axis
    hull_points, hull_discs = hull.reshape(-1, 3), radii.reshape(-1)
    return Part(vertices, faces, units, hull_points, hull_discs, len(centers), sheet)


def _with_lids(rows: Array) -> Array:
    """Add rows that lead from the axis to the first row and from the last row back to the axis.

    An end that already lies on the axis gets none.
    """
    parts = [rows]
    for end, way in ((rows[0], 1.0), (rows[-1], -1.0)):
        if end[:2].max() > 0.0:
            rim = np.concatenate([end[:4], way * end[:3], [0.0]])
            axis = np.concatenate([0 * end[:3], rim[3:]])
            parts = [np.stack([axis, rim]), *parts] if way > 0 else [*parts, np.stack([rim, axis])]
    return np.concatenate(parts)


def outline(segments: int, is_round: bool) -> tuple[Array, Array]:
    """Return the directions around a rounded rectangle's corners, and their quadrants' signs.

    Both are (n, 2).
    """
    quarter = segments // 4
    steps = np.arange(quarter + (not is_round))
    angle = np.add.outer(np.arange(4) * quarter, steps).ravel() * (2 * np.pi / segments)
    outward = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    outward[np.abs(outward) < 1e-15] = 0.0
    quadrant = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]], float)
    return outward, np.repeat(quadrant, len(steps), axis=0)


def section(sizes: Array, outward: Array, quadrant: Array) -> Array:
    """Return the outlines of m rounded rectangles, (m, n, 2); linear in the sizes.

    Args:
        sizes: half width, half depth and corner radius of each, (m, 3).
        outward, quadrant: as `outline` returns them.
    """
    radius = sizes[:, None, 2:]
    return np.asarray(quadrant * (sizes[:, None, :2] - radius) + outward * radius)


def strips(grid: Array, normals: Array) -> tuple[Array, Array, Array, Array]:
    """Return vertices, triangles, unit normals and the sheet (see `Part`) of closed outlines.

    Triangles lie between neighbouring rows.

    Strips without width (a crease repeats a row) and triangles without area (rows on an axis, arcs
    of radius 0) are left out.

    Args:
        grid: points, (copies, rows, around, 3); the copies differ in place only.
        normals: of any length, same shape.
    """
    copies, rows, count = grid.shape[:3]
    first = grid[0]
    low = np.flatnonzero(np.abs(first[1:] - first[:-1]).max(axis=(1, 2)) > 1e-12)[:, None]
    around = np.arange(count)
    after = np.roll(around, -1)
    is_edge = np.abs(first[:, after] - first).max(axis=2) > 1e-12  # from each corner to the next
    a, b, c, d = (at + np.zeros_like(low) for at in (around, around, after, after))
    a, b, c, d = a + low * count, b + (low + 1) * count, c + (low + 1) * count, d + low * count
    upper, lower = is_edge[low[:, 0] + 1], is_edge[low[:, 0]]
    corners = np.concatenate(
        [
            np.stack([a[upper], b[upper], c[upper]], axis=1),
            np.stack([a[lower], c[lower], d[lower]], axis=1),
        ]
    )
    used = np.zeros(rows * count, bool)
    used[corners] = True
    number = np.cumsum(used) - 1
    vertices, normals = (table.reshape(copies, -1, 3)[:, used] for table in (grid, normals))
    faces = np.arange(copies)[:, None, None] * vertices.shape[1] + number[corners]
    x, y, z = (normals[..., i] for i in range(3))
    length = np.sqrt(x * x + y * y + z * z)
    unit = normals / np.maximum(length, 1e-300)[..., None]
    sheet = np.tile(_sheet(first)[used], (copies, 1))
    return vertices.reshape(-1, 3), faces.reshape(-1, 3), unit.reshape(-1, 3), sheet


def _sheet(grid: Array) -> Array:
    """Return how far around and along the points, (rows, around, 3), lie; (rows * around, 3).

    Distances around are those of the row whose perimeter is the median one.
    """
    steps = np.linalg.norm(np.roll(grid, -1, axis=1) - grid, axis=2)
    perimeter = steps.sum(axis=1)
    row = int(np.argsort(perimeter)[(len(perimeter) + (perimeter < 1e-9).sum()) // 2])
    along = np.linalg.norm(np.diff(grid, axis=0), axis=2).mean(axis=1)
    sheet = np.empty(grid.shape)
    sheet[..., 0] = np.cumsum(steps[row]) - steps[row]
    sheet[..., 1] = np.cumsum([0.0, *along])[:, None]
    sheet[..., 2] = perimeter[row]
    return sheet.reshape(-1, 3)


def joined(
    meshes: Sequence[tuple[Array, Array, Array]],
) -> tuple[Array, Array, Array]:
    """Return vertices, faces and normals of several meshes as those of a single one."""
    vertices, faces, normals = zip(*meshes, strict=True)
    first = np.cumsum([0, *map(len, vertices[:-1])])
    moved = [part + start for part, start in zip(faces, first.tolist(), strict=True)]
    return np.concatenate(vertices), np.concatenate(moved), np.concatenate(normals)
