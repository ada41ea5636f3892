"""OFF files in text form. Colours, normals and texture coordinates are ignored."""

import re
from collections.abc import Iterator
from itertools import chain, islice

from scenegen.objects.meshes.errors import BadMeshError
from scenegen.objects.meshes.readers.polygons import NOWHERE
from scenegen.objects.meshes.readers.text import FAR, PolygonList, lines
from scenegen.objects.solids import Array


def read_off(data: bytes) -> tuple[Array, Array]:
    """Return vertices (V, 3) and triangles (F, 3) of an OFF, COFF, NOFF or STOFF file.

    The counts may follow the keyword on the first line, as in some files of ModelNet ("OFF490 518
    0"). Where the file has not one line for each vertex and face, it is read as a stream of
    numbers. Lines that cannot be read are treated as in OBJ files.

    Raises:
        BadMeshError: this is no OFF file in text form, it holds more or less than it says, or is
            too large.
    """
    rows = _filled(data)
    first = next(rows, [b""])
    header = re.fullmatch(rb"(ST)?(C)?(N)?OFF(\d+)?", first[0])
    if not header or first[1:2] == [b"BINARY"]:
        raise BadMeshError("OFF file", "a first line other than OFF", "an OFF file in text form")
    counts = ([header[4]] if header[4] else []) + first[1:] or next(rows, [])
    try:
        vertex_count, face_count = (max(int(word), 0) for word in counts[:2])
    except ValueError:
        expected = "the numbers of vertices and faces"
        raise BadMeshError("OFF file", "no counts", expected) from None
    expected = f"{vertex_count} vertices and {face_count} faces"
    lines_after = sum(1 for _ in _filled(data)) - 1 - (not header[4] and not first[1:])
    if len(counts) > 3 or lines_after != vertex_count + face_count:
        width = 3 + 2 * bool(header[1]) + 4 * bool(header[2]) + 3 * bool(header[3])
        words = chain(counts[3:], chain.from_iterable(rows))
        rows = _cut(words, vertex_count, width, face_count, expected)
    polygons = PolygonList()
    for row in islice(rows, vertex_count):
        polygons.add_vertex(row[:3])
    for row in rows:
        polygons.add_face(_face(row))
    return polygons.polygons().triangulated()


def _filled(data: bytes) -> Iterator[list[bytes]]:
    """Yield the words of each line that has any outside comments."""
    rows = (line.partition(b"#")[0].split() for line in lines(data))
    return (row for row in rows if row)


def _cut(
    words: Iterator[bytes], vertex_count: int, width: int, face_count: int, expected: str
) -> Iterator[list[bytes]]:
    """Cut a stream of numbers into a row for each vertex and face; faces have no colours."""
    hint = "it is cut short, or broken"
    for i in range(vertex_count + face_count):
        size = [next(words, b"")] if i >= vertex_count else []
        if size and not size[0].isdigit():
            raise BadMeshError("OFF file", "fewer numbers", expected, hint)
        count = min(int(size[0]), FAR) if size else width
        row = [*size, *islice(words, count)]
        if len(row) != len(size) + count:
            raise BadMeshError("OFF file", "fewer numbers", expected, hint)
        yield row
    if next(words, None) is not None:
        raise BadMeshError("OFF file", "more numbers", expected, hint)


def _face(words: list[bytes]) -> list[int]:
    try:
        size = int(words[0])
        face = [min(max(int(word), NOWHERE), FAR) for word in words[1 : size + 1]]
    except ValueError:
        return [NOWHERE]
    return face if len(face) == size else [NOWHERE]
