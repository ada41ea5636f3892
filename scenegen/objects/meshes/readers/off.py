"""OFF files in text form. Colours, normals and texture coordinates are ignored."""

import re
from itertools import islice

from scenegen.objects.meshes.errors import BadMeshError
from scenegen.objects.meshes.readers.polygons import NOWHERE
from scenegen.objects.meshes.readers.text import FAR, PolygonList, lines
from scenegen.objects.solids import Array


def read_off(data: bytes) -> tuple[Array, Array]:
    """Return vertices (V, 3) and triangles (F, 3) of an OFF, COFF, NOFF or STOFF file.

    The counts may follow the keyword on the first line, as in some files of ModelNet ("OFF490 518
    0"). Lines that cannot be read are treated as in OBJ files.

    Raises:
        BadMeshError: this is no OFF file in text form, it is shorter than it says, or too large.
    """
    rows = (line.partition(b"#")[0].split() for line in lines(data))
    rows = (words for words in rows if words)
    first = next(rows, [b""])
    header = re.fullmatch(rb"(?:ST)?C?N?OFF(\d+)?", first[0])
    if not header or first[1:2] == [b"BINARY"]:
        raise BadMeshError("OFF file", "a first line other than OFF", "an OFF file in text form")
    counts = ([header[1]] if header[1] else []) + first[1:] or next(rows, [])
    try:
        vertex_count, face_count = (int(word) for word in counts[:2])
    except ValueError:
        expected = "the numbers of vertices and faces"
        raise BadMeshError("OFF file", "no counts", expected) from None
    found = PolygonList()
    for words in islice(rows, max(vertex_count, 0)):
        found.add_vertex(words[:3])
    for words in islice(rows, max(face_count, 0)):
        found.add_face(_face(words))
    if (found.vertex_count, found.face_count) != (vertex_count, face_count):
        there = f"{found.vertex_count} vertices and {found.face_count} faces"
        raise BadMeshError("OFF file", there, f"{vertex_count} and {face_count}", "it is cut short")
    return found.polygons().triangulated()


def _face(words: list[bytes]) -> list[int]:
    try:
        size = int(words[0])
        face = [min(max(int(word), NOWHERE), FAR) for word in words[1 : size + 1]]
    except ValueError:
        return [NOWHERE]
    return face if len(face) == size else [NOWHERE]
