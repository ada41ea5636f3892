"""The unit shapes of a data set, each once, in one Mitsuba scene that is built once per process."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from scenegen.objects.shapes import unit_shape
from scenegen.objects.solids import UnitShape

Array = NDArray[Any]
LATTICE = 4.0  # distance between the shapes' origins; their bounding radius is 1
OVERLAP = 4e-6  # of neighbouring triangles; the least without slips is 2e-6
SPHERE = 0xFFFFFFFF  # instead of the first triangle, where a shape is the exact sphere


@dataclass(frozen=True, eq=False)
class UnitScene:
    """Shapes on a compact centred lattice, ready to be cast at.

    Attributes:
        scene: the Mitsuba scene.
        offset: where each shape's origin lies, (S, 3).
        first_triangle: each shape's first row of `normals`, or SPHERE, (S,) uint32.
        grid: distance between the points that rays may start from, 0 if they start anywhere.
        normals: face normal and three corner normals of each triangle, (1 + F, 12) as flat
            floats of the variant; row 0 belongs to no triangle.
    """

    scene: Any
    offset: Array
    first_triangle: Array
    grid: float
    normals: Any


@lru_cache(maxsize=4)
def unit_scene(variant: str, shapes: tuple[str, ...]) -> UnitScene:
    """Build the scene of these shapes for a Mitsuba variant."""
    mi.set_variant(variant)
    side = int(np.ceil(len(shapes) ** (1 / 3)))
    cell = np.stack(np.unravel_index(np.arange(len(shapes)), (side, side, side)), axis=1)
    offset = (cell - (side - 1) / 2) * LATTICE
    contents: dict[str, Any] = {"type": "scene"}
    tables = []
    for name, place in zip(shapes, offset, strict=True):
        shape = unit_shape(name)
        contents[name] = mitsuba_shape(shape, place)
        tables.append(normal_table(shape))
    first_triangle, normals = stacked(tables)
    return UnitScene(mi.load_dict(contents), offset, first_triangle, 0.0, normals)


def normal_table(shape: UnitShape) -> Array:
    """Return face normal and three corner normals of each triangle, (F, 12) float32; of the exact
    sphere none, (0, 12).
    """
    if shape.is_sphere:
        return np.zeros((0, 12), np.float32)
    edges = shape.triangles[:, 1:] - shape.triangles[:, :1]
    face = np.stack(_cross(edges[:, 0].T, edges[:, 1].T), axis=1)
    face /= np.sqrt(np.einsum("fi,fi->f", face, face))[:, None]
    table = np.empty((len(face), 12), np.float32)
    table[:, :3], table[:, 3:] = face, shape.normals.reshape(-1, 9)
    return table


def stacked(tables: Sequence[Array]) -> tuple[Array, Any]:
    """Return the first row of each table in all of them together, and these as flat floats."""
    sizes = np.array([len(table) for table in tables])
    first = np.where(sizes > 0, 1 + np.cumsum(sizes) - sizes, SPHERE).astype(np.uint32)
    return first, mi.Float(np.concatenate([np.zeros((1, 12), np.float32), *tables]).ravel())


def mitsuba_shape(shape: UnitShape, place: Array) -> Any:
    """Return the unit shape, moved to `place`, as Mitsuba geometry of the variant in force."""
    if shape.is_sphere:
        return {"type": "sphere", "center": place.tolist(), "radius": 1.0}
    return triangle_mesh(shape.name, overlapping(shape.triangles) + place)


def triangle_mesh(
    name: str, triangles: Array, normals: Array | None = None, bsdf: Any = None
) -> Any:
    """Return triangles (F, 3, 3), with normals at their corners or flat, as Mitsuba's mesh."""
    count = 3 * len(triangles)
    properties = mi.Properties()
    if bsdf is not None:
        properties["bsdf"] = bsdf
    mesh = mi.Mesh(name, count, len(triangles), properties, has_vertex_normals=normals is not None)
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = triangles.astype(np.float32).ravel()
    parameters["faces"] = np.arange(count, dtype=np.uint32)
    if normals is not None:
        parameters["vertex_normals"] = normals.astype(np.float32).ravel()
    parameters.update()
    return mesh


def overlapping(triangles: Array) -> Array:
    """Move the edges of triangles, (F, 3, 3), outwards by OVERLAP, each in its plane.

    A ray that meets an edge within rounding would otherwise slip through now and then: the test of
    either triangle may find it outside. No corner moves further than four times that.
    """
    edges = triangles[:, _NEXT] - triangles  # from each corner to the next
    length = np.sqrt(np.einsum("fki,fki->fk", edges, edges))
    along = edges / np.maximum(length, 1e-30)[..., None]
    # From a corner to its two neighbours; the edges that they are not on move along their sum.
    outward = along[:, _BEFORE] - along
    first, second = edges[:, 0].T, edges[:, 1].T
    double_area = np.sqrt(sum(c * c for c in _cross(first, second)))
    sine = double_area[:, None] / np.maximum(length * length[:, _BEFORE], 1e-30)
    reach = np.sqrt(np.einsum("fki,fki->fk", outward, outward))
    scale = OVERLAP / np.maximum(np.maximum(sine, reach / 4), 1e-30)
    return np.asarray(triangles + outward * scale[..., None])


_NEXT, _BEFORE = [1, 2, 0], [2, 0, 1]


def _cross(a: Array, b: Array) -> tuple[Array, Array, Array]:
    """Cross product by components, several times as fast as NumPy's."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
