"""Triangulation of polygons with any number of corners, convex or not."""

from dataclasses import dataclass

import mapbox_earcut
import numpy as np

from scenegen.objects.meshes import limits
from scenegen.objects.meshes.errors import BadMeshError, check_most
from scenegen.objects.solids import Array

NOWHERE = -1  # stands for a vertex index that could not be read
_SMALL_AREA = 1e-9  # of a polygon whose squared distances from the middle add up to 1


@dataclass(frozen=True, eq=False)
class Polygons:
    """Faces as they are in a file.

    Attributes:
        vertices: (V, 3); may hold NaN or infinity.
        sizes: number of corners of each polygon, (P,).
        corners: indices into the vertices, polygon after polygon, (C,); may be out of range.
    """

    vertices: Array
    sizes: Array
    corners: Array

    def triangulated(self) -> tuple[Array, Array]:
        """Return vertices (V, 3) and triangles (F, 3).

        A polygon with an index out of range becomes one triangle out of range, and one with fewer
        than three corners a triangle without area, so that cleaning counts them as defects.

        Raises:
            BadMeshError: there are more than MOST_FACES triangles, or polygons that would take too
                long to cut.
        """
        check_most("faces", int(np.maximum(self.sizes - 2, 1).sum()), limits.MOST_FACES)
        start = np.cumsum(self.sizes) - self.sizes
        in_range = (self.corners >= 0) & (self.corners < len(self.vertices))
        corners = np.where(in_range, self.corners, NOWHERE)
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
            if work > limits.MOST_EAR_CLIPPING:
                found, hint = f"faces of {size} corners", "split them in a mesh editor"
                raise BadMeshError("faces", found, "smaller ones", hint)
            parts.extend(clip_ears(self.vertices[face], face) for face in others)
        return self.vertices, np.concatenate(parts)


def _fans(vertices: Array, faces: Array) -> tuple[list[Array], Array]:
    """Cut polygons of n corners, (P, n), into fans of triangles; return these and the rest.

    A fan whose triangles all face the same way covers its polygon exactly once. A quadrilateral
    whose sides do not cross has such a fan at its first or at its second corner.
    """
    size = faces.shape[1]
    if size == 3:
        return [faces], faces[:0]
    good = faces_one_way(vertices[faces])
    fans, others = [_fan(faces[good])], faces[~good]
    if size == 4:
        return [*fans, _fan(np.roll(others, -1, axis=1))], others[:0]
    return fans, others


def _fan(faces: Array) -> Array:
    first = np.broadcast_to(faces[:, :1], (len(faces), faces.shape[1] - 2))
    return np.stack([first, faces[:, 1:-1], faces[:, 2:]], axis=2).reshape(-1, 3)


def faces_one_way(points: Array) -> Array:
    """Return whether all triangles of each fan face the same way, (P, n, 3) -> (P,)."""
    spokes = points[:, 1:] - points[:, :1]
    cross = np.cross(spokes[:, :-1], spokes[:, 1:])
    normal = cross.sum(axis=1, keepdims=True)
    facing = (cross * normal).sum(axis=2)
    return np.asarray((facing >= -1e-9 * (normal**2).sum(axis=2)).all(axis=1))


def clip_ears(points: Array, face: Array) -> Array:
    """Cut one polygon, (n, 3), by ear clipping in the plane that fits it best."""
    centered = points - points.mean(axis=0)
    centered /= np.sqrt((centered**2).sum())
    if not np.isfinite(centered).all():
        return _fan(face[None])
    normal = np.cross(centered, np.roll(centered, -1, axis=0)).sum(axis=0)
    if np.linalg.norm(normal) < _SMALL_AREA:  # its sides cross so that areas cancel
        normal = np.linalg.svd(centered, full_matrices=False)[2][2]
    normal /= np.linalg.norm(normal)
    # Two axes perpendicular to the normal, from the coordinate axis least parallel to it.
    u = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
    u /= np.linalg.norm(u)
    flat = np.ascontiguousarray(centered @ np.stack([u, np.cross(normal, u)], axis=1))
    ears = mapbox_earcut.triangulate_float64(flat, np.array([len(flat)], np.uint32))
    if not len(ears):  # all corners lie on a line; cleaning drops and counts the triangles
        return _fan(face[None])
    return np.asarray(face[np.asarray(ears, np.int64)].reshape(-1, 3))
