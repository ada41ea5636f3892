"""STL files, binary and text; a file that starts with "solid" may be either."""

from array import array
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.objects.meshes.errors import BadMeshError
from scenegen.objects.meshes.readers.text_lines import lines, point

Array = NDArray[Any]
_HEAD = 84
_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("extra", "<u2")])


def read_stl(data: bytes) -> tuple[Array, Array]:
    """Return vertices, three of each triangle's own, (3 F, 3), and triangles (F, 3).

    Raises:
        BadMeshError: neither form, or cut short.
    """
    count = int.from_bytes(data[80:_HEAD], "little") if len(data) >= _HEAD else -1
    whole = count >= 0 and _HEAD + count * _FACET.itemsize <= len(data)
    is_text = data.lstrip()[:5].lower() == b"solid" and b"facet" in data[:4096].lower()
    if is_text and not (whole and _HEAD + count * _FACET.itemsize == len(data)):
        vertices = _text(data)
    elif whole:
        corners = np.frombuffer(data, _FACET, count, _HEAD)["corners"]
        vertices = corners.reshape(-1, 3).astype(np.float64)
    elif count >= 0:
        there = (len(data) - _HEAD) // _FACET.itemsize
        raise BadMeshError(f"is no STL file, or cut short: {there} of {count} triangles")
    else:
        raise BadMeshError("is no STL file: it is shorter than a header")
    return vertices, np.arange(len(vertices)).reshape(-1, 3)


def _text(data: bytes) -> Array:
    corners = array("d")
    for line in lines(data):
        words = line.split()
        if words and words[0].lower() == b"vertex":
            corners.extend(point(words[1:4]))
    if len(corners) % 9:
        raise BadMeshError(f"the STL file is cut short: {len(corners) // 3} corners of triangles")
    return np.array(corners, np.float64).reshape(-1, 3)
