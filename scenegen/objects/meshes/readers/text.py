"""What the text formats OBJ, OFF and STL share: lines, points, and polygons added one by one."""

import codecs
import io
import math
from array import array
from collections.abc import Iterator

import numpy as np

from scenegen.objects.meshes import limits
from scenegen.objects.meshes.errors import check_most
from scenegen.objects.meshes.readers.polygons import Polygons

FAR = 1 << 40  # larger than any vertex number; keeps huge numbers within 64 bits
_NOT_FINITE = (math.nan, math.nan, math.nan)


def lines(data: bytes) -> Iterator[bytes]:
    """Return the lines of UTF-8, Latin-1 or UTF-16 text, with any line ending."""
    return iter(io.BytesIO(utf8(data)))


def utf8(data: bytes) -> bytes:
    """Return such text without a mark of its encoding, with line ends that have a newline."""
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        data = data.decode("utf-16", "replace").encode("utf-8", "replace")
    data = data.removeprefix(codecs.BOM_UTF8)
    if b"\n" not in data:
        data = data.replace(b"\r", b"\n")
    return data


def point(words: list[bytes]) -> tuple[float, float, float]:
    """Return three numbers, or NaNs where the words are not three numbers."""
    try:
        x, y, z = map(float, words)
    except ValueError:
        return _NOT_FINITE
    return x, y, z


class PolygonList:
    """Vertices and polygons, added one by one up to MOST_CORNERS of each."""

    def __init__(self) -> None:
        self._coordinates, self._sizes, self._corners = array("d"), array("q"), array("q")

    @property
    def vertex_count(self) -> int:
        """The number of vertices so far."""
        return len(self._coordinates) // 3

    @property
    def face_count(self) -> int:
        """The number of polygons so far."""
        return len(self._sizes)

    def add_vertex(self, words: list[bytes]) -> None:
        """Add a vertex from three words."""
        self._coordinates.extend(point(words))
        check_most("vertices", self.vertex_count, limits.MOST_CORNERS)

    def add_face(self, corners: list[int]) -> None:
        """Add a polygon from the indices of its vertices."""
        self._sizes.append(len(corners))
        self._corners.extend(corners)
        check_most("corners of faces", len(self._corners), limits.MOST_CORNERS)

    def polygons(self) -> Polygons:
        """Return all that was added."""
        return Polygons(
            np.array(self._coordinates, np.float64).reshape(-1, 3),
            np.array(self._sizes, np.int64),
            np.array(self._corners, np.int64),
        )
