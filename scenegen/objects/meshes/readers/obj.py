"""Wavefront OBJ files. Materials, textures, normals and groups are ignored.

Lines that cannot be read become vertices that are not finite and faces that are out of range, which
cleaning drops and counts: one bad line does not lose a model.
"""

from itertools import chain

from scenegen.objects.meshes.readers.polygons import NOWHERE, Polygons
from scenegen.objects.meshes.readers.text import FAR, PolygonList, lines
from scenegen.objects.solids import Array


def read_obj(data: bytes) -> tuple[Array, Array]:
    """Return vertices (V, 3) and triangles (F, 3). Raises BadMeshError if there are too many."""
    return obj_polygons(data).triangulated()


def obj_polygons(data: bytes) -> Polygons:
    """Return the vertices and polygons of a file. Raises BadMeshError if there are too many."""
    polygons = PolygonList()
    held: list[bytes] = []  # words of a line that continues on the next one
    for line in chain(lines(data), (b"",)):  # even the last line may end with a backslash
        if line.startswith((b"vt", b"vn")):  # half of the lines of most files
            continue
        words = line.split()
        if held:
            held.extend(words)
            words, held = held, []
        if not words or words[0] not in (b"v", b"f", b"fo"):
            continue  # names and paths may end with a backslash, too, but do not continue
        if words[-1].endswith(b"\\"):
            held = words
            held[-1] = held[-1][:-1]
            if not held[-1]:
                held.pop()
        elif words[0] == b"v":
            polygons.add_vertex(words[1:4])
        else:
            polygons.add_face(_face(words[1:], polygons.vertex_count))
    return polygons.polygons()


def _face(words: list[bytes], vertex_count: int) -> list[int]:
    """Return vertex indices of `3`, `3/1`, `3//2` or `-1`; negative ones count from the last."""
    try:
        numbers = [int(word.partition(b"/")[0]) for word in words]
    except ValueError:
        comment = next((i for i, word in enumerate(words) if word.startswith(b"#")), None)
        return [NOWHERE] if comment is None else _face(words[:comment], vertex_count)
    if numbers and (min(numbers) < 1 or max(numbers) > FAR):
        return [
            min(n, FAR) - 1 if n > 0 else vertex_count + n if -vertex_count <= n < 0 else NOWHERE
            for n in numbers
        ]
    return [n - 1 for n in numbers]
