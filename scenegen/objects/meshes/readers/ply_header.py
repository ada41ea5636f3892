"""What a PLY file says about itself before its data."""

from dataclasses import dataclass

from scenegen.objects.meshes.errors import BadMeshError

_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2",
    "ushort": "u2", "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4",
    "int64": "i8", "uint64": "u8", "float": "f4", "float32": "f4", "double": "f8", "float64": "f8",
}  # fmt: skip
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_LONGEST_HEADER = 1 << 16


@dataclass(frozen=True)
class Property:
    """A column: its name, the type of its values, and of their count if it holds lists."""

    name: str
    type: str
    count_type: str | None = None


@dataclass(frozen=True)
class Element:
    """A table of the file."""

    name: str
    rows: int
    properties: tuple[Property, ...]


def read_header(data: bytes) -> tuple[str, list[Element], bytes]:
    """Return the byte order ("" for text), the tables, and the data that follow.

    Raises:
        BadMeshError: no PLY file, or a line that is not understood.
    """
    end = data.find(b"end_header", 0, _LONGEST_HEADER)
    if not data.startswith(b"ply") or end < 0:
        raise BadMeshError("is no PLY file: it does not start with ply ... end_header")
    order, elements = None, []
    for line in data[:end].decode("latin-1").splitlines():
        words = line.split()
        try:
            if words[:1] == ["format"]:
                order = _ORDERS[words[1]]
            elif words[:1] == ["element"]:
                elements.append(Element(words[1], int(words[2]), ()))
            elif words[:1] == ["property"]:
                *types, name = words[2:] if words[1] == "list" else words[1:]
                types = [_TYPES[word] for word in types]
                one = Property(name, types[-1], types[0] if words[1] == "list" else None)
                last = elements[-1]
                elements[-1] = Element(last.name, last.rows, (*last.properties, one))
        except (IndexError, KeyError, ValueError):
            raise BadMeshError(f"the PLY file's header has a broken line: {line[:80]!r}") from None
    if order is None or any(not 0 <= e.rows <= len(data) for e in elements):
        raise BadMeshError("the PLY file's header has no format, or tells of more than there is")
    body = data[end + len("end_header") :]
    return order, elements, body[2:] if body.startswith(b"\r\n") else body[1:]
