"""STL files, binary and text. A file that starts with "solid" may be either."""

from array import array

import numpy as np

from scenegen.objects.meshes.errors import BadMeshError
from scenegen.objects.meshes.readers.text import lines, point
from scenegen.objects.solids import Array

_HEADER_BYTES = 84
_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("extra", "<u2")])


def read_stl(data: bytes) -> tuple[Array, Array]:
    """Return vertices (3 F, 3), three for each triangle, and triangles (F, 3).

    Raises:
        BadMeshError: the file has neither form, or is cut short.
    """
    # In binary files within the limits the last byte of the count, the 84th, is 0.
    if data.lstrip()[:5].lower() == b"solid" and b"\0" not in data[:_HEADER_BYTES]:
        vertices = _text(data)
    elif len(data) < _HEADER_BYTES:
        found = f"{len(data)} bytes"
        raise BadMeshError("STL file", found, f"a header of {_HEADER_BYTES} bytes")
    else:
        count = int.from_bytes(data[80:_HEADER_BYTES], "little")
        held = (len(data) - _HEADER_BYTES) // _FACET.itemsize
        if count != held:
            hint = "export it again" if count < held else "it is cut short, or no STL file"
            raise BadMeshError(
                "STL file", f"{held} triangles", f"{count}, as its header says", hint
            )
        corners = np.frombuffer(data, _FACET, count, _HEADER_BYTES)["corners"]
        vertices = corners.reshape(-1, 3).astype(np.float64)
    return vertices, np.arange(len(vertices)).reshape(-1, 3)


def _text(data: bytes) -> Array:
    corners = array("d")
    for line in lines(data):
        words = line.split()
        if words and words[0].lower() == b"vertex":
            corners.extend(point(words[1:4]))
    if len(corners) % 9:
        found = f"{len(corners) // 3} corners"
        raise BadMeshError("STL file", found, "three for each triangle", "it is cut short")
    return np.array(corners, np.float64).reshape(-1, 3)
