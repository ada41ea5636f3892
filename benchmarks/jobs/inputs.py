"""What the jobs share: the scenes of a finished rooms file, and unit meshes for other renderers."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from trimesh.grouping import unique_rows

from scenegen.description.scenes import SceneSpec
from scenegen.description.specs import DatasetSpec
from scenegen.objects.solids import UnitShape
from scenegen.rooms.reader import RoomsFile

Array = NDArray[Any]
COARSE_FROM = 1000  # triangles; shapes with fewer stay as they are
COARSE_GRID = 6  # cells in a unit, to whose corners coarse meshes are rounded


def read_scenes(rooms: str, count: int) -> tuple[DatasetSpec, list[SceneSpec]]:
    """Return a file's spec and its first `count` scenes."""
    with RoomsFile(rooms) as file:
        return file.spec, [file.scene(row) for row in range(count)]


def read_depth(rooms: str, count: int) -> Array:
    """Return the first `count` depth maps, to check that others cast the same rays."""
    with RoomsFile(rooms) as file:
        return np.asarray(file.read("depth", slice(0, count)))


@dataclass(frozen=True, eq=False)
class Mesh:
    """Corners (V, 3), their normals (V, 3) and triangles (F, 3)."""

    points: Array
    normals: Array
    faces: Array


def unit_meshes(
    names: Iterable[str], coarse: bool, shape_of: Callable[[str], UnitShape]
) -> dict[str, Mesh]:
    """Return the welded unit meshes of all shapes but the exact sphere.

    Coarse ones have about a thousand triangles, which a user may accept who has to build them anew
    for every scene. They look coarse, and are here for their speed alone.
    """
    shapes = {name: shape_of(name) for name in names}
    return {name: _weld(shape, coarse) for name, shape in shapes.items() if not shape.is_sphere}


def moved(mesh: Mesh, world_from_object: Array) -> Mesh:
    """Apply a similarity (4, 4); normals keep their directions only."""
    linear = world_from_object[:3, :3].T
    return Mesh(mesh.points @ linear + world_from_object[:3, 3], mesh.normals @ linear, mesh.faces)


def join(meshes: list[Mesh]) -> Mesh:
    """Put meshes into one."""
    starts = np.cumsum([0, *(len(mesh.points) for mesh in meshes)])
    faces = [mesh.faces + start for mesh, start in zip(meshes, starts[:-1], strict=True)]
    parts = ([mesh.points for mesh in meshes], [mesh.normals for mesh in meshes], faces)
    return Mesh(*map(np.concatenate, parts))


def _weld(shape: UnitShape, coarse: bool) -> Mesh:
    points, normals = shape.triangles.reshape(-1, 3), shape.normals.reshape(-1, 3)
    drawn = coarse and len(shape.triangles) >= COARSE_FROM
    if drawn:
        points = np.round(points * COARSE_GRID) / COARSE_GRID
    corners = points if drawn else np.concatenate([points, normals], axis=1)
    first, number = unique_rows(corners, digits=6)
    faces = number.reshape(-1, 3)
    if drawn:
        faces = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
        faces = faces[np.unique(np.sort(faces, axis=1), axis=0, return_index=True)[1]]
    return Mesh(
        points[first].astype(np.float32), normals[first].astype(np.float32), faces.astype(np.uint32)
    )
