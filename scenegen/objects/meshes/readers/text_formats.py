"""OBJ and OFF files as polygons. Materials, textures, normals and groups are passed over.

Lines that cannot be read become vertices that are not finite and faces that are out of range, to
be dropped and counted when the mesh is cleaned: one bad line does not lose a model.
"""

import re
from array import array
from itertools import chain, islice

import numpy as np

from scenegen.objects.meshes.errors import BadMeshError
from scenegen.objects.meshes.limits import MOST_CORNERS
from scenegen.objects.meshes.readers.polygons import NOWHERE, Polygons
from scenegen.objects.meshes.readers.text_lines import lines, point

_FAR = 1 << 40  # more vertices than any file has


class _Faces:
    """Vertices and polygons as they come in."""

    def __init__(self) -> None:
        self.coordinates, self.sizes, self.corners = array("d"), array("q"), array("q")

    def add_vertex(self, words: list[bytes]) -> None:
        self.coordinates.extend(point(words))
        if len(self.coordinates) > 3 * MOST_CORNERS:
            raise BadMeshError(f"has more than {MOST_CORNERS} vertices; simplify it")

    def add_face(self, face: list[int]) -> None:
        self.sizes.append(len(face))
        self.corners.extend(face)
        if len(self.corners) > MOST_CORNERS:
            raise BadMeshError(f"its faces have more than {MOST_CORNERS} corners; simplify it")

    def polygons(self) -> Polygons:
        return Polygons(
            np.array(self.coordinates, np.float64).reshape(-1, 3),
            np.array(self.sizes, np.int64),
            np.array(self.corners, np.int64),
        )


def read_obj(data: bytes) -> Polygons:
    """Read a Wavefront OBJ file. Raises BadMeshError where it has too many faces."""
    found = _Faces()
    held: list[bytes] = []  # of lines that go on in the next one
    for line in chain(lines(data), (b"",)):  # the last one, too, may say that it goes on
        if line.startswith((b"vt", b"vn")):  # half of most files
            continue
        words = line.split()
        if held:
            held.extend(words)
            words, held = held, []
        if not words or words[0] not in (b"v", b"f", b"fo"):
            continue  # also names and paths that end with a backslash: they do not go on
        if words[-1].endswith(b"\\"):
            held = words
            held[-1] = held[-1][:-1]
            if not held[-1]:
                held.pop()
        elif words[0] == b"v":
            found.add_vertex(words[1:4])
        else:
            found.add_face(_obj_face(words[1:], len(found.coordinates) // 3))
    return found.polygons()


def _obj_face(words: list[bytes], known: int) -> list[int]:
    """Return vertices of `3`, `3/1`, `3//2`, `-1/-1/-1`; minus counts back from the last one."""
    try:
        numbers = [int(word.partition(b"/")[0]) for word in words]
    except ValueError:
        comment = next((i for i, word in enumerate(words) if word.startswith(b"#")), None)
        return [NOWHERE] if comment is None else _obj_face(words[:comment], known)
    if numbers and (min(numbers) < 1 or max(numbers) > _FAR):
        return [
            min(n, _FAR) - 1 if n > 0 else known + n if -known <= n < 0 else NOWHERE
            for n in numbers
        ]
    return [n - 1 for n in numbers]


def read_off(data: bytes) -> Polygons:
    """Read an OFF file: OFF, COFF, NOFF, STOFF; also where the counts follow on the first line.

    Raises:
        BadMeshError: no OFF file, a binary one, fewer lines than it says, or too many faces.
    """
    rows = (line.partition(b"#")[0].split() for line in lines(data))
    rows = (words for words in rows if words)
    first = next(rows, [b""])
    header = re.fullmatch(rb"(?:ST)?C?N?OFF(\d+)?", first[0])
    if not header or first[1:2] == [b"BINARY"]:
        raise BadMeshError("is no OFF file in text form: its first line does not say OFF")
    # "OFF490 518 0", as some of ModelNet's have it
    counts = ([header[1]] if header[1] else []) + first[1:] or next(rows, [])
    try:
        vertex_count, face_count = (int(word) for word in counts[:2])
    except ValueError:
        raise BadMeshError("the OFF file does not tell its numbers of vertices and faces") from None
    found = _Faces()
    for words in islice(rows, max(vertex_count, 0)):
        found.add_vertex(words[:3])
    for words in islice(rows, max(face_count, 0)):
        found.add_face(_off_face(words))
    if (len(found.coordinates) // 3, len(found.sizes)) != (vertex_count, face_count):
        raise BadMeshError(
            f"the OFF file is cut short: it tells of {vertex_count} vertices and {face_count} "
            f"faces, found {len(found.coordinates) // 3} and {len(found.sizes)}"
        )
    return found.polygons()


def _off_face(words: list[bytes]) -> list[int]:
    try:
        size = int(words[0])
        face = [min(max(int(word), NOWHERE), _FAR) for word in words[1 : size + 1]]
    except ValueError:
        return [NOWHERE]
    return face if len(face) == size else [NOWHERE]
