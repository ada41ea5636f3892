"""Mesh files as vertices and triangles, whatever state they and their surroundings are in.

Only geometry is read, and only from the file itself: no materials, textures or other files. The
readers are the project's own: they take bounded time and memory, keep models with some broken
lines, and cut polygons that are not convex where they should be cut.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.objects.meshes.errors import BadMeshError
from scenegen.objects.meshes.limits import MOST_BYTES
from scenegen.objects.meshes.readers.glb import read_glb
from scenegen.objects.meshes.readers.ply import read_ply
from scenegen.objects.meshes.readers.stl import read_stl
from scenegen.objects.meshes.readers.text_formats import read_obj, read_off

Array = NDArray[Any]
_READERS: dict[str, Callable[[bytes], tuple[Array, Array]]] = {
    ".glb": read_glb,
    ".obj": lambda data: read_obj(data).triangulated(),
    ".off": lambda data: read_off(data).triangulated(),
    ".ply": lambda data: read_ply(data).triangulated(),
    ".stl": read_stl,
}


def read_bytes(path: str | Path) -> bytes:
    """Return a file's bytes.

    Raises:
        BadMeshError: not there, not readable, empty, no regular file, or above MOST_BYTES.
    """
    path = Path(path)
    try:
        if not path.is_file():
            kind = "is no regular file" if path.exists() else "the file does not exist"
            raise BadMeshError(kind)
        with path.open("rb") as file:
            data = file.read(MOST_BYTES + 1)
    except OSError as error:
        raise BadMeshError(f"cannot be read: {error.strerror}") from error
    if len(data) > MOST_BYTES:
        raise BadMeshError(f"has more than {MOST_BYTES} bytes; simplify it")
    if not data.strip(b"\0\t\n\r "):
        raise BadMeshError("the file is empty")
    return data


def read_mesh(path: str | Path) -> tuple[Array, Array]:
    """Return vertices (V, 3), which may be not finite, and triangles (F, 3), maybe out of range.

    Raises:
        BadMeshError: the file is not what its name says, is cut short, or needs other files.
    """
    return parse_mesh(read_bytes(path), Path(path).suffix)


def parse_mesh(data: bytes, suffix: str) -> tuple[Array, Array]:
    """Return the mesh in a file's bytes, as `read_mesh`."""
    reader = _READERS.get(suffix.lower())
    if reader is None:
        known = ", ".join(_READERS)
        raise BadMeshError(f"found a file of type {suffix!r}, expected one of {known}")
    try:
        with np.errstate(all="ignore"):  # numbers that are not finite are dealt with later
            return reader(data)
    except (BadMeshError, MemoryError):
        raise
    except Exception as error:  # one bad model must not stop a run of a million
        kind = suffix[1:].upper()
        raise BadMeshError(
            f"is no {kind} file that can be read ({type(error).__name__}: {error}); export it anew"
        ) from error
