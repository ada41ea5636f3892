"""Read a mesh file of any supported format into vertices and triangles.

Only geometry is read, and only from the file itself: no materials, textures or other files. The
project has its own readers because they need bounded time and memory, keep models that have a few
broken lines, and triangulate polygons that are not convex correctly.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from scenegen.objects.meshes import limits
from scenegen.objects.meshes.errors import BadMeshError
from scenegen.objects.meshes.readers.glb import read_glb
from scenegen.objects.meshes.readers.obj import read_obj
from scenegen.objects.meshes.readers.off import read_off
from scenegen.objects.meshes.readers.ply import read_ply
from scenegen.objects.meshes.readers.stl import read_stl
from scenegen.objects.solids import Array

_READERS: dict[str, Callable[[bytes], tuple[Array, Array]]] = {
    ".glb": read_glb,
    ".obj": read_obj,
    ".off": read_off,
    ".ply": read_ply,
    ".stl": read_stl,
}


def read_bytes(path: str | Path) -> bytes:
    """Return a file's bytes.

    Raises:
        BadMeshError: the file is missing, unreadable, empty, not regular, or above MOST_BYTES.
    """
    path = Path(path)
    try:
        if not path.is_file():
            found = "a folder or a device" if path.exists() else "no such file"
            raise BadMeshError("file", found, "a regular file")
        with path.open("rb") as file:
            data = file.read(limits.MOST_BYTES + 1)
    except OSError as error:
        raise BadMeshError("file", f"an error ({error.strerror})", "a readable file") from error
    if len(data) > limits.MOST_BYTES:
        expected = f"at most {limits.MOST_BYTES} bytes"
        raise BadMeshError("file", "more bytes", expected, "simplify the model")
    if not data.strip(b"\0\t\n\r "):
        raise BadMeshError("file", "nothing in it", "a mesh")
    return data


def parse_mesh(data: bytes, suffix: str) -> tuple[Array, Array]:
    """Return vertices (V, 3), perhaps not finite, and triangles (F, 3), perhaps out of range.

    Args:
        data: the content of a mesh file.
        suffix: the file's suffix, such as ".obj", in upper or lower case.

    Raises:
        BadMeshError: the file is not what its suffix says, is too large or cut short, or needs
            other files.
    """
    reader = _READERS.get(suffix.lower())
    if reader is None:
        raise BadMeshError("suffix", repr(suffix), f"one of {', '.join(_READERS)}")
    try:
        with np.errstate(all="ignore"):  # cleaning handles numbers that are not finite
            return reader(data)
    except (BadMeshError, MemoryError):
        raise
    except Exception as error:  # one bad model must not stop a run of a million
        where, found = f"{suffix[1:].upper()} file", f"{type(error).__name__}: {error}"
        raise BadMeshError(where, found, "a readable file", "export it again") from error
