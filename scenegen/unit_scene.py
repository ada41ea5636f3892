"""The unit shapes of a data set, each once, in one Mitsuba scene that is built once per process."""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from scenegen.shapes import unit_shape
from scenegen.solids import UnitShape

Array = NDArray[Any]
LATTICE = 4.0  # distance between the shapes' origins; their bounding radius is 1
SPHERE = 0xFFFFFFFF  # instead of the first triangle, where a shape is the exact sphere


@dataclass(frozen=True, eq=False)
class UnitScene:
    """Shapes on a compact centred lattice, ready to be cast at.

    Attributes:
        scene: the Mitsuba scene.
        offset: where each shape's origin lies, (S, 3).
        first_triangle: each shape's first row of `normals`, or SPHERE, (S,) uint32.
        normals: face normal and three corner normals of each triangle, (1 + F, 12) as flat
            floats of the variant; row 0 belongs to no triangle.
    """

    scene: Any
    offset: Array
    first_triangle: Array
    normals: Any


@lru_cache(maxsize=4)
def unit_scene(variant: str, shapes: tuple[str, ...]) -> UnitScene:
    """Build the scene of these shapes for a Mitsuba variant."""
    mi.set_variant(variant)
    side = int(np.ceil(len(shapes) ** (1 / 3)))
    cell = np.stack(np.unravel_index(np.arange(len(shapes)), (side, side, side)), axis=1)
    offset = (cell - (side - 1) / 2) * LATTICE
    contents: dict[str, Any] = {"type": "scene"}
    first_triangle, tables, rows = [], [np.zeros((1, 12))], 1
    for name, place in zip(shapes, offset, strict=True):
        shape = unit_shape(name)
        contents[name] = mitsuba_shape(shape, place)
        if shape.is_sphere:
            first_triangle.append(SPHERE)
            continue
        edges = shape.triangles[:, 1:] - shape.triangles[:, :1]
        face = np.cross(edges[:, 0], edges[:, 1])
        face /= np.linalg.norm(face, axis=1, keepdims=True)
        tables.append(np.concatenate([face, shape.normals.reshape(-1, 9)], axis=1))
        first_triangle.append(rows)
        rows += len(face)
    return UnitScene(
        mi.load_dict(contents),
        offset,
        np.array(first_triangle, np.uint32),
        mi.Float(np.concatenate(tables).astype(np.float32).ravel()),
    )


def mitsuba_shape(shape: UnitShape, place: Array) -> Any:
    """Return the unit shape, moved to `place`, as Mitsuba geometry of the variant in force."""
    if shape.is_sphere:
        return {"type": "sphere", "center": place.tolist(), "radius": 1.0}
    count = len(shape.triangles)
    mesh = mi.Mesh(shape.name, vertex_count=3 * count, face_count=count)
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = (shape.triangles + place).astype(np.float32).ravel()
    parameters["faces"] = np.arange(3 * count, dtype=np.uint32)
    parameters.update()
    return mesh
