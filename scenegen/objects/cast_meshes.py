"""Shapes in the form that the ray caster takes: triangles grown by a hair, and their normals."""

from dataclasses import dataclass

import numpy as np

from scenegen.common.rotations import cross
from scenegen.objects.solids import Array, UnitShape

OVERLAP = 4e-6  # of neighbouring triangles; rays slip between them if it is below 2e-6
_NEXT, _BEFORE = [1, 2, 0], [2, 0, 1]


@dataclass(frozen=True, eq=False)
class CastMesh:
    """What is cast and shaded. The exact sphere has no triangles.

    Attributes:
        triangles: corners as from `overlapping`, (F, 3, 3) float32.
        normals: as from `normal_table`, (F, 12) float32.
    """

    triangles: Array
    normals: Array


def cast_mesh(shape: UnitShape) -> CastMesh:
    """Return a unit shape as the ray caster takes it."""
    triangles = shape.triangles[:0] if shape.is_sphere else shape.triangles
    return CastMesh(overlapping(triangles).astype(np.float32), normal_table(shape))


def normal_table(shape: UnitShape) -> Array:
    """Return face normal and three corner normals of each triangle, (F, 12) float32.

    The exact sphere has none, (0, 12).
    """
    if shape.is_sphere:
        return np.zeros((0, 12), np.float32)
    edges = shape.triangles[:, 1:] - shape.triangles[:, :1]
    face = np.stack(cross(edges[:, 0].T, edges[:, 1].T), axis=1)
    face /= np.sqrt(np.einsum("fi,fi->f", face, face))[:, None]
    table = np.empty((len(face), 12), np.float32)
    table[:, :3], table[:, 3:] = face, shape.normals.reshape(-1, 9)
    return table


def overlapping(triangles: Array) -> Array:
    """Move the edges of triangles, (F, 3, 3), outwards by OVERLAP, within their planes.

    Otherwise a ray that meets a shared edge may slip through, as rounding can put it outside both
    triangles. No corner moves by more than four times OVERLAP.
    """
    edges = triangles[:, _NEXT] - triangles  # from each corner to the next
    length = np.sqrt(np.einsum("fki,fki->fk", edges, edges))
    along = edges / np.maximum(length, 1e-30)[..., None]
    # Moving a corner against the sum of its two edges' directions moves both edges outwards.
    outward = along[:, _BEFORE] - along
    first, second = edges[:, 0].T, edges[:, 1].T
    double_area = np.sqrt(sum(c * c for c in cross(first, second)))
    sine = double_area[:, None] / np.maximum(length * length[:, _BEFORE], 1e-30)
    reach = np.sqrt(np.einsum("fki,fki->fk", outward, outward))
    scale = OVERLAP / np.maximum(np.maximum(sine, reach / 4), 1e-30)
    return np.asarray(triangles + outward * scale[..., None])
