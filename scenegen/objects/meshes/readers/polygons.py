"""Triangles from polygons of any number of corners, convex or not."""

from dataclasses import dataclass
from typing import Any

import mapbox_earcut
import numpy as np
from numpy.typing import NDArray

from scenegen.objects.meshes.errors import BadMeshError
from scenegen.objects.meshes.limits import MOST_FACES

Array = NDArray[Any]
NOWHERE = -1  # the vertex of a corner that could not be read
_MOST_WORK = 1e10  # squares of corners of polygons whose ears are clipped: some 20 seconds
_SMALL_AREA = 1e-9  # of a polygon, by the sum of its corners' squared distances from the middle


@dataclass(frozen=True, eq=False)
class Polygons:
    """Faces as a file has them.

    Attributes:
        vertices: (V, 3), may be not finite.
        sizes: corners of each polygon, (P,).
        corners: indices into the vertices, polygon after polygon, (C,); may be out of range.
    """

    vertices: Array
    sizes: Array
    corners: Array

    def triangulated(self) -> tuple[Array, Array]:
        """Return vertices and triangles (F, 3).

        A polygon that is out of range is one triangle out of range, one of fewer than three
        corners a triangle without an area: nobody can keep them, so they are counted as defects.

        Raises:
            BadMeshError: too many triangles, or polygons that would take too long.
        """
        count = int(np.maximum(self.sizes - 2, 1).sum())
        if count > MOST_FACES:
            raise BadMeshError(f"has {count} faces, at most {MOST_FACES} are used; simplify it")
        start = np.cumsum(self.sizes) - self.sizes
        known = (self.corners >= 0) & (self.corners < len(self.vertices))
        corners = np.where(known, self.corners, NOWHERE)
        parts = [np.empty((0, 3), np.int64)]
        work = 0.0
        for size in np.unique(self.sizes):
            if size == 0:
                parts.append(np.full(((self.sizes == 0).sum(), 3), NOWHERE))
                continue
            faces = corners[start[self.sizes == size][:, None] + np.arange(size)]
            whole = (faces != NOWHERE).all(axis=1)
            parts.append(np.full(((~whole).sum(), 3), NOWHERE))
            faces = faces[whole]
            if size < 3:
                parts.append(faces[:, [0, -1, -1]])
                continue
            fans, others = _fans(self.vertices, faces)
            parts.extend(fans)
            work += float(size) ** 2 * len(others)
            if work > _MOST_WORK:
                raise BadMeshError(f"has faces of {size} corners; split them in a mesh program")
            parts.extend(_clip_ears(self.vertices[face], face) for face in others)
        return self.vertices, np.concatenate(parts)


def _fans(vertices: Array, faces: Array) -> tuple[list[Array], Array]:
    """Cut polygons of one size, (P, n), into fans of triangles; return these and the other ones.

    A fan is right if all its triangles face one way: then it covers the polygon once. Of four
    corners, one of any two that are neighbours has such a fan, if the sides do not cross.
    """
    size = faces.shape[1]
    if size == 3:
        return [faces], faces[:0]
    good = _faces_one_way(vertices[faces])
    fans, others = [_fan(faces[good])], faces[~good]
    if size == 4:
        return [*fans, _fan(np.roll(others, -1, axis=1))], others[:0]
    return fans, others


def _fan(faces: Array) -> Array:
    first = np.broadcast_to(faces[:, :1], (len(faces), faces.shape[1] - 2))
    return np.stack([first, faces[:, 1:-1], faces[:, 2:]], axis=2).reshape(-1, 3)


def _faces_one_way(points: Array) -> Array:
    """Whether all of a fan's triangles agree with the polygon's normal: (P, n, 3) -> (P,)."""
    spokes = points[:, 1:] - points[:, :1]
    cross = np.cross(spokes[:, :-1], spokes[:, 1:])
    normal = cross.sum(axis=1, keepdims=True)
    facing = (cross * normal).sum(axis=2)
    return np.asarray((facing >= -1e-9 * (normal**2).sum(axis=2)).all(axis=1))


def _clip_ears(points: Array, face: Array) -> Array:
    """Cut one polygon, (n, 3), in the plane that it lies in, or nearly."""
    centered = points - points.mean(axis=0)
    centered /= np.sqrt((centered**2).sum())
    if not np.isfinite(centered).all():
        return _fan(face[None])
    normal = np.cross(centered, np.roll(centered, -1, axis=0)).sum(axis=0)
    if np.linalg.norm(normal) < _SMALL_AREA:  # its sides cross such that areas cancel
        normal = np.linalg.svd(centered, full_matrices=False)[2][2]
    normal /= np.linalg.norm(normal)
    # Two axes across the normal, from the coordinate axis that is farthest from it.
    u = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
    u /= np.linalg.norm(u)
    flat = np.ascontiguousarray(centered @ np.stack([u, np.cross(normal, u)], axis=1))
    ears = mapbox_earcut.triangulate_float64(flat, np.array([len(flat)], np.uint32))
    if not len(ears):  # all on a line; its triangles are then dropped and counted
        return _fan(face[None])
    return np.asarray(face[np.asarray(ears, np.int64)].reshape(-1, 3))
