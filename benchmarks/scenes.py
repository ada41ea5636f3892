"""The scenes that all rows of the table share: those that stand in a finished rooms file."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.description.scenes import SceneSpec
from scenegen.description.specs import DatasetSpec
from scenegen.objects.catalogue import Objects
from scenegen.objects.sources import file_objects
from scenegen.rooms.reader import RoomsFile

Array = NDArray[Any]


def read_scenes(rooms: str, count: int) -> tuple[DatasetSpec, list[SceneSpec]]:
    """Return the request that the file answers, and its first `count` scenes."""
    with RoomsFile(rooms) as file:
        return file.spec, [file.scene(row) for row in range(count)]


def read_objects(spec: DatasetSpec, root: str) -> Objects:
    """Return what the scenes are made of: built in, or the meshes of a folder."""
    return file_objects(spec, objects_root=root or None)


def read_depth(rooms: str, count: int) -> Array:
    """Return the first `count` depth maps, to check that the others cast the same rays."""
    with RoomsFile(rooms) as file:
        return np.asarray(file.read("depth", slice(0, count)))
