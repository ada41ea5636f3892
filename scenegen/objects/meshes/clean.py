"""Meshes mended and brought to one size: what comes out is what is rendered, to the bit.

The surface is never moved by more than the rounding to single precision. Only faces without an
area, or narrower than NARROWEST, and second copies of faces go.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.objects.meshes.errors import BadMeshError
from scenegen.objects.meshes.limits import MOST_FACES

__all__ = ["MOST_FACES", "BadMeshError", "CleanMesh", "clean_mesh"]
Array = NDArray[Any]
MOST_COORDINATE = 1e30  # beyond it, and if not finite, a coordinate is taken for noise
NARROWEST = 1e-6  # height of a triangle over its longest edge, in bounding radii
LOWEST = 1e-4  # height of a model that lies flat, in bounding radii
_COLLINEAR = 1e-10  # height over the longest edge, divided by that edge
_ROUNDS = 8


@dataclass(frozen=True, eq=False)
class CleanMesh:
    """A mesh y up, the centre of its box at the origin, its farthest vertex at distance 1.

    Attributes:
        vertices: (V, 3) float32, each once, all used.
        faces: (F, 3) int32; every one has an area, and no two the same vertices.
        mended: how many of what were found: unused_vertices, merged_vertices,
            faces_out_of_range, faces_not_finite, degenerate_faces, double_faces.
    """

    vertices: Array
    faces: Array
    mended: Mapping[str, int]

    @property
    def triangles(self) -> Array:
        """Corners, (F, 3, 3) float32."""
        return np.asarray(self.vertices[self.faces])


def clean_mesh(vertices: Array, faces: Array, up: str = "y") -> CleanMesh:
    """Mend a mesh and normalise it.

    Args:
        vertices: (V, 3), any scale and place, may be not finite.
        faces: (F, 3) indices, may be out of range.
        up: the axis, "y" or "z", that points up in the file.

    Raises:
        BadMeshError: above MOST_FACES faces; no face left that has an area; no height to stand.
    """
    vertices = np.asarray(vertices, np.float64).reshape(-1, 3)
    faces = np.asarray(faces, np.int64).reshape(-1, 3)
    if len(faces) > MOST_FACES:
        raise BadMeshError(f"has {len(faces)} faces, at most {MOST_FACES} are used; simplify it")
    if not len(faces):
        raise BadMeshError(f"has {len(vertices)} vertices but no faces")
    found: dict[str, int] = {}

    def keep(good: Any, name: str) -> None:
        nonlocal faces
        found[name] = found.get(name, 0) + int(len(good) - good.sum())
        faces = faces[good]

    keep(((faces >= 0) & (faces < len(vertices))).all(axis=1), "faces_out_of_range")
    with np.errstate(invalid="ignore"):
        usable = np.asarray((np.abs(vertices) < MOST_COORDINATE).all(axis=1))
    keep(usable[faces].all(axis=1), "faces_not_finite")
    keep(_heights(vertices[faces]) > 0, "degenerate_faces")
    turned = vertices if up == "y" else vertices[:, [0, 2, 1]] * (1, 1, -1)
    points = np.empty((0, 3), np.float32)
    for _ in range(_ROUNDS):  # a sliver that stuck out has its say in the size no longer
        if not len(faces):
            raise BadMeshError(f"no face is left that has an area ({_told(found)})")
        points = _normalised(turned, faces)
        wide = _heights(points[faces].astype(np.float64), NARROWEST) > 0
        keep(wide, "degenerate_faces")
        if wide.all():
            break
    if np.ptp(points[faces.ravel(), 1]) < LOWEST:
        raise BadMeshError(
            "lies flat: it has no height and would be one with the floor; "
            "if it stands in other programs, its up axis is another (--up)"
        )
    used = np.zeros(len(points), bool)
    used[faces] = True
    found["unused_vertices"] = int(len(used) - used.sum())
    points, number = _merged(points, used)
    found["merged_vertices"] = int(used.sum()) - len(points)
    faces = number[faces]
    keep(_first_copies(faces), "double_faces")
    return CleanMesh(points, faces.astype(np.int32), found)


def _told(found: Mapping[str, int]) -> str:
    return ", ".join(f"{n} {name.replace('_', ' ')}" for name, n in found.items() if n)


def _normalised(vertices: Array, faces: Array) -> Array:
    """Return all vertices, float32, such that those of the faces fill the unit sphere."""
    used = vertices[faces.ravel()]
    low, high = used.min(axis=0), used.max(axis=0)
    center, extent = low / 2 + high / 2, (high - low).max()
    radius = np.sqrt((((used - center) / extent) ** 2).sum(axis=1).max())
    points = np.zeros(vertices.shape, np.float32)  # of vertices that no face uses: anything
    points[faces.ravel()] = (used - center) / extent / radius
    return np.asarray(points + np.float32(0))  # no -0.0, which would differ from 0.0 in its bits


def _heights(triangles: Array, narrowest: float = 0.0) -> Array:
    """Return heights over longest edges, (F, 3, 3) -> (F,); 0 on a line and below `narrowest`."""
    edges = np.roll(triangles, -1, axis=1) - triangles
    lengths = np.sqrt(np.einsum("fki,fki->fk", edges, edges))
    longest = lengths.max(axis=1, initial=0.0)
    cross = np.cross(edges[:, 0], edges[:, 1])
    area = np.sqrt(np.einsum("fi,fi->f", cross, cross))
    heights = np.divide(area, longest, out=np.zeros(len(area)), where=longest > 0)
    least = np.maximum(narrowest, _COLLINEAR * longest)
    return np.where(heights > least, heights, 0.0)


def _merged(points: Array, used: Array) -> tuple[Array, Array]:
    """Return the different ones of the used points, (V, 3), and each old point's number there."""
    rows = np.flatnonzero(used)
    rows = rows[np.lexsort(points[rows].T)]
    ordered = points[rows]
    is_new = np.ones(len(rows), bool)
    is_new[1:] = (ordered[1:] != ordered[:-1]).any(axis=1)
    number = np.zeros(len(points), np.int64)
    number[rows] = np.cumsum(is_new) - 1
    return ordered[is_new], number


def _first_copies(faces: Array) -> Array:
    """Mark faces, (F, 3), but for those with the same vertices as an earlier one."""
    corners = np.sort(faces, axis=1)
    order = np.lexsort(corners.T)  # stable: the earliest of equals comes first
    ordered = corners[order]
    first = np.ones(len(faces), bool)
    first[order[1:]] = (ordered[1:] != ordered[:-1]).any(axis=1)
    return first
