"""Furniture as models of a data set: `furnishing`s in the place of unit shapes.

A furnishing is centred at the middle of its box, and its bounding radius is 1, as that of all unit
shapes. So an object of a closed room is placed by the same similarity as all other objects.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from scenegen.common.recent import recent
from scenegen.objects.coarse_hulls import POINT_STEP, rounded
from scenegen.objects.furniture.furnishing import MESH, Furnishing, supports
from scenegen.objects.furniture.room_shell import box_hull
from scenegen.objects.solids import Mesh, UnitShape

Array = NDArray[Any]
SIZE_STEP = 2.0**-12  # metres, to which sizes are rounded
UPRIGHT = np.array([[0.0, -1.0, 0.0]])


@dataclass(frozen=True, eq=False)
class Piece:
    """What placing needs of a piece of furniture, in its own frame: centred, on y = 0, front +z.

    Attributes:
        name: of the model, as in `scenes.PlacedObject.shape`.
        family: whose place it takes, as of `Furnishing`.
        half: half its width along x and half its depth along z, metres.
        height: metres.
        radius: of the sphere about the middle of its box.
        surfaces: horizontal rectangles (y, x0, x1, z0, z1) on which things stand.
        boxes: least and greatest corner of each triangle, (2, F, 3); none without surfaces.
    """

    name: str
    family: str
    half: tuple[float, float]
    height: float
    radius: float
    surfaces: tuple[tuple[float, ...], ...]
    boxes: Array


class Furnished(NamedTuple):
    """A furnishing; its vertices, (V, 3), in units of its radius about its middle; the radius."""

    thing: Furnishing
    vertices: Array
    radius: float


def furniture_shape(name: str, thing: Furnishing) -> UnitShape:
    """Return a piece of furniture as a unit shape.

    Rounded, as cosines and sums differ in their last bits between processors.
    """
    low, high = thing.vertices.min(axis=0), thing.vertices.max(axis=0)
    moved = thing.vertices - (low + high) / 2
    radius = float(np.sqrt((moved * moved).sum(axis=1).max()))
    radius = float(np.ceil(radius / SIZE_STEP) * SIZE_STEP)
    vertices = rounded(moved / radius, POINT_STEP)

    def mesh() -> Mesh:
        if thing.number == MESH:
            return Mesh(vertices, thing.faces, None)
        faces = np.arange(3 * len(thing.faces)).reshape(-1, 3)
        normals = rounded(thing.corner_normals, POINT_STEP).reshape(-1, 3)
        return Mesh(vertices[thing.faces].reshape(-1, 3), faces, normals)

    made = Furnished(thing, vertices, radius)
    return UnitShape(name, mesh, *box_hull(vertices), 0.0, UPRIGHT, furnished=made)


@recent(20_000_000)  # bytes: some 1,100 pieces; 32 rooms, which share theirs, show about 400
def piece(shape_of: Callable[[str], UnitShape], name: str) -> Piece:
    """Return a piece of furniture as it is placed. Raises as `shape_of`."""
    made = shape_of(name).furnished
    assert made is not None
    thing, vertices, radius = made
    high = vertices.max(axis=0)
    half = np.ceil(high * radius / SIZE_STEP) * SIZE_STEP
    corners = (vertices * radius + [0.0, half[1], 0.0])[thing.faces]
    surfaces = tuple(
        tuple(float(np.ceil(v / SIZE_STEP) * SIZE_STEP) for v in rectangle)
        for rectangle in supports(thing)
    )
    boxes = (
        np.stack([corners.min(axis=1), corners.max(axis=1)]) if surfaces else np.zeros((2, 0, 3))
    )
    across, up, along = half.tolist()
    return Piece(name, thing.family, (across, along), 2 * up, radius, surfaces, boxes)
