"""Mend a mesh and normalise its size. The result is rendered as it is, bit for bit.

The surface moves by no more than the rounding to single precision. Only faces without area or
narrower than NARROWEST, and second copies of faces, are removed.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from scenegen.objects.meshes import limits
from scenegen.objects.meshes.errors import BadMeshError, check_most
from scenegen.objects.solids import Array

MOST_COORDINATE = 1e30  # faces with a larger coordinate, or one that is not finite, are dropped
NARROWEST = 1e-6  # least height of a triangle over its longest edge, in bounding radii
LOWEST = 1e-4  # least height of a model, in bounding radii
_COLLINEAR = 1e-10  # least height over the longest edge, divided by that edge
_ROUNDS = 8  # of dropping slivers and normalising again


@dataclass(frozen=True, eq=False)
class CleanMesh:
    """A mesh with y up, its bounding box centred at 0 and its farthest vertex at distance 1.

    Attributes:
        vertices: (V, 3) float32, all different, all used.
        faces: (F, 3) int32; each has an area, and no two have the same vertices.
        kept: which of the faces given they are, (F,).
        mended: counts of what was removed: unused_vertices, merged_vertices, faces_out_of_range,
            faces_not_finite, degenerate_faces, double_faces.
    """

    vertices: Array
    faces: Array
    kept: Array
    mended: Mapping[str, int]


def clean_mesh(vertices: Array, faces: Array, up: str = "y") -> CleanMesh:
    """Mend a mesh and normalise it.

    Args:
        vertices: (V, 3), of any scale and place; may hold NaN or infinity.
        faces: (F, 3) indices; may be out of range.
        up: the axis, "y" or "z", that points up in the file.

    Raises:
        BadMeshError: there are more than MOST_FACES faces, none with an area, or the mesh is flat
            on the floor.
    """
    vertices = np.asarray(vertices, np.float64).reshape(-1, 3)
    faces = np.asarray(faces, np.int64).reshape(-1, 3)
    check_most("faces", len(faces), limits.MOST_FACES)
    if not len(faces):
        raise BadMeshError("faces", f"none, but {len(vertices)} vertices")
    mended: dict[str, int] = {}
    kept = np.arange(len(faces))

    def keep(good: Any, name: str) -> None:
        nonlocal faces, kept
        mended[name] = mended.get(name, 0) + int(len(good) - good.sum())
        faces, kept = faces[good], kept[good]

    keep(((faces >= 0) & (faces < len(vertices))).all(axis=1), "faces_out_of_range")
    with np.errstate(invalid="ignore"):
        usable = np.asarray((np.abs(vertices) < MOST_COORDINATE).all(axis=1))
    keep(usable[faces].all(axis=1), "faces_not_finite")
    keep(_heights(vertices[faces]) > 0, "degenerate_faces")
    turned = vertices if up == "y" else vertices[:, [0, 2, 1]] * (1, 1, -1)
    points = np.empty((0, 3), np.float32)
    for _ in range(_ROUNDS):  # dropping a sliver that stuck out changes the size
        if not len(faces):
            counts = ", ".join(f"{n} {name.replace('_', ' ')}" for name, n in mended.items() if n)
            raise BadMeshError("faces", f"none with an area ({counts})")
        points = normalised(turned, faces)
        wide = _heights(points[faces].astype(np.float64), NARROWEST) > 0
        keep(wide, "degenerate_faces")
        if wide.all():
            break
    if np.ptp(points[faces.ravel(), 1]) < LOWEST:
        raise BadMeshError(
            "height",
            "none, so the mesh would be part of the ground",
            hint="if the mesh is upright in other programs, another axis points up (--up)",
        )
    used = np.zeros(len(points), bool)
    used[faces] = True
    mended["unused_vertices"] = int(len(used) - used.sum())
    points, number = _merged(points, used)
    mended["merged_vertices"] = int(used.sum()) - len(points)
    faces = number[faces]
    keep(_first_copies(faces), "double_faces")
    return CleanMesh(points, faces.astype(np.int32), kept, mended)


def normalised(vertices: Array, faces: Array) -> Array:
    """Return all vertices, float32, scaled such that those of the faces fill the unit sphere."""
    used = vertices[faces.ravel()]
    low, high = used.min(axis=0), used.max(axis=0)
    center, extent = low / 2 + high / 2, (high - low).max()
    radius = np.sqrt((((used - center) / extent) ** 2).sum(axis=1).max())
    points = np.zeros(vertices.shape, np.float32)  # vertices that no face uses stay 0
    points[faces.ravel()] = (used - center) / extent / radius
    return np.asarray(points + np.float32(0))  # turns -0.0 into 0.0, which has other bits


def _heights(triangles: Array, narrowest: float = 0.0) -> Array:
    """Return triangles' heights over their longest edges, (F, 3, 3) -> (F,).

    The height is 0 where it is below `narrowest` or the corners lie on a line.
    """
    edges = np.roll(triangles, -1, axis=1) - triangles
    lengths = np.sqrt(np.einsum("fki,fki->fk", edges, edges))
    longest = lengths.max(axis=1, initial=0.0)
    cross = np.cross(edges[:, 0], edges[:, 1])
    area = np.sqrt(np.einsum("fi,fi->f", cross, cross))
    heights = np.divide(area, longest, out=np.zeros(len(area)), where=longest > 0)
    least = np.maximum(narrowest, _COLLINEAR * longest)
    return np.where(heights > least, heights, 0.0)


def _merged(points: Array, used: Array) -> tuple[Array, Array]:
    """Return the used points without duplicates, and the new number of each old point."""
    rows = np.flatnonzero(used)
    rows = rows[np.lexsort(points[rows].T)]
    ordered = points[rows]
    is_new = np.ones(len(rows), bool)
    is_new[1:] = (ordered[1:] != ordered[:-1]).any(axis=1)
    number = np.zeros(len(points), np.int64)
    number[rows] = np.cumsum(is_new) - 1
    return ordered[is_new], number


def _first_copies(faces: Array) -> Array:
    """Return a mask of the faces, (F, 3), that do not repeat an earlier one's vertices."""
    corners = np.sort(faces, axis=1)
    order = np.lexsort(corners.T)  # a stable sort: the earliest of equal faces comes first
    ordered = corners[order]
    first = np.ones(len(faces), bool)
    first[order[1:]] = (ordered[1:] != ordered[:-1]).any(axis=1)
    return first
