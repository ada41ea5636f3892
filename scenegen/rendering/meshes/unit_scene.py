"""The basic shapes of a data set in one Mitsuba scene, which is built once per process.

Those with exact surfaces are left out: `surfaces.in_kernel` casts rays at them.
`model_scene` does the same for models, of which there are too many for one scene.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from scenegen.common.records import check
from scenegen.objects.cast_meshes import corner_table, normal_table, overlapping
from scenegen.objects.solids import UnitShape
from scenegen.rendering.tables import padded, upload_table

Array = NDArray[Any]
LATTICE = 4.0  # distance between the shapes' origins; their bounding radius is 1
NO_TRIANGLE = 0xFFFFFFFF  # stands for the first triangle of a shape without triangles


@dataclass(frozen=True, eq=False)
class UnitScene:
    """Shapes on a compact lattice around the origin, ready for casting rays.

    Attributes:
        scene: the Mitsuba scene.
        offset: position of each shape's origin, (S, 3).
        first_triangle: each shape's first row in `normals`, or NO_TRIANGLE, (S,)
            uint32.
        grid: spacing of the grid from whose points rays start; 0 if they may start anywhere.
        normals, corners: of each triangle, as from `cast_meshes.normal_table` and `corner_table`,
            (1 + F, 12) as tables of `tables.upload_table`; row 0 belongs to no triangle.
    """

    scene: Any
    offset: Array
    first_triangle: Array
    grid: float
    normals: Any
    corners: Any


@lru_cache(maxsize=4)
def unit_scene(variant: str, shapes: tuple[UnitShape, ...]) -> UnitScene:
    """Build the scene of those of the shapes that have no exact surface."""
    mi.set_variant(variant)
    side = int(np.ceil(len(shapes) ** (1 / 3)))
    cell = np.stack(np.unravel_index(np.arange(len(shapes)), (side, side, side)), axis=1)
    offset = (cell - (side - 1) / 2) * LATTICE
    contents: dict[str, Any] = {"type": "scene"}
    normals, corners = [], []
    for shape, place in zip(shapes, offset, strict=True):
        meshed = shape.surface is None
        if meshed:
            contents[shape.name] = mitsuba_shape(shape, place)
        normals.append(normal_table(shape) if meshed else np.empty((0, 12), np.float32))
        corners.append(corner_table(shape) if meshed else np.empty((0, 12), np.float32))
    first_triangle, table = stacked(normals)
    scene = mi.load_dict(contents)
    return UnitScene(scene, offset, first_triangle, 0.0, table, stacked(corners)[1])


def stacked(tables: Sequence[Array]) -> tuple[Array, Any]:
    """Join tables of normals; return the first row of each, or NO_TRIANGLE, and all.

    Raises SpecError for more triangles than a float counts, as rows of objects hold their number.
    """
    sizes = np.array([len(table) for table in tables])
    most = 2**24 - 1
    check(sizes.sum() <= most, "one scene", f"{sizes.sum():,} triangles", f"at most {most:,}")
    first = np.where(sizes > 0, 1 + np.cumsum(sizes) - sizes, NO_TRIANGLE).astype(np.uint32)
    return first, upload_table(np.concatenate([np.zeros((1, 12), np.float32), *tables]))


def mitsuba_shape(shape: UnitShape, place: Array) -> Any:
    """Return the unit shape, moved to `place`, as geometry of the current Mitsuba variant."""
    return triangle_mesh(shape.name, overlapping(shape.triangles) + place)


def triangle_mesh(name: str, triangles: Array) -> Any:
    """Return triangles, (F, 3, 3), as a Mitsuba mesh."""
    mesh = mi.Mesh(name, 3 * len(triangles), len(triangles))
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = padded(triangles)
    parameters["faces"] = padded(np.arange(3 * len(triangles)), np.uint32)
    parameters.update()
    return mesh
