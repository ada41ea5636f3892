"""PLY files: text, and binary of either byte order."""

import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from scenegen.objects.meshes import limits
from scenegen.objects.meshes.errors import BadMeshError
from scenegen.objects.meshes.readers.polygons import Polygons
from scenegen.objects.solids import Array

_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2",
    "ushort": "u2", "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4",
    "int64": "i8", "uint64": "u8", "float": "f4", "float32": "f4", "double": "f8", "float64": "f8",
}  # fmt: skip
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_CODES = {
    "i1": "b", "u1": "B", "i2": "h", "u2": "H", "i4": "i", "u4": "I", "i8": "q", "u8": "Q",
    "f4": "f", "f8": "d",
}  # fmt: skip


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


def read_ply(data: bytes) -> tuple[Array, Array]:
    """Return vertices (V, 3) and triangles (F, 3).

    Raises:
        BadMeshError: the file is no PLY file, is broken, has no vertices or too many faces.
    """
    order, elements, body = _read_header(data)
    take = _text_rows(body) if not order else _binary_rows(body, order)
    vertices, sizes, corners = None, np.empty(0, np.int64), np.empty(0, np.int64)
    for element in elements:
        columns = take(element)
        if element.name == "vertex":
            if not {"x", "y", "z"} <= set(columns):
                raise BadMeshError("PLY file's vertices", ", ".join(columns), "x, y and z")
            vertices = np.stack([np.asarray(columns[axis], np.float64) for axis in "xyz"], axis=1)
        elif element.name == "face":
            lists = columns.get("vertex_indices", columns.get("vertex_index"))
            if not isinstance(lists, tuple):
                raise BadMeshError("PLY file's faces", ", ".join(columns), "vertex_indices")
            sizes, corners = lists
        if vertices is not None and len(sizes):
            break
    if vertices is None:
        raise BadMeshError("PLY file", "no vertices")
    return Polygons(vertices, sizes, corners).triangulated()


def _read_header(data: bytes) -> tuple[str, list[Element], bytes]:
    """Return the byte order ("" for text), the tables, and the bytes that follow the header."""
    end = data.find(b"end_header", 0, limits.MOST_HEADER_BYTES)
    if not data.startswith(b"ply") or end < 0:
        raise BadMeshError("PLY file", "no header", "ply ... end_header")
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
                column = Property(name, types[-1], types[0] if words[1] == "list" else None)
                last = elements[-1]
                elements[-1] = Element(last.name, last.rows, (*last.properties, column))
        except (IndexError, KeyError, ValueError):
            raise BadMeshError("PLY file's header", f"a broken line, {line[:80]!r}") from None
    if order is None or any(not 0 <= e.rows <= len(data) for e in elements):
        found = "no format, or more rows than the file has bytes"
        raise BadMeshError("PLY file's header", found)
    body = data[end + len("end_header") :]
    return order, elements, body[2:] if body.startswith(b"\r\n") else body[1:]


# Takes the next table; returns its columns, arrays or (sizes, values) of lists, by name.
TakeTable = Callable[[Element], dict[str, Any]]


def _text_rows(body: bytes) -> TakeTable:
    lines = iter(body.splitlines())

    def take(element: Element) -> dict[str, Any]:
        values: list[list[float]] = [[] for _ in element.properties]
        sizes: list[list[int]] = [[] for _ in element.properties]
        for row in _filled(lines, element.rows):
            words = row.split()

            def take_words(count: int, words: list[bytes] = words) -> list[bytes]:
                while len(words) < count:  # a long list may go on in the next line
                    words.extend(next(_filled(lines, 1)).split())
                taken, words[:count] = words[:count], []
                return taken

            for column, kind in enumerate(element.properties):
                count = int(take_words(1)[0]) if kind.count_type else 1
                values[column].extend(map(float, take_words(count)))
                sizes[column].append(count)
        return {
            kind.name: (np.array(sizes[i], np.int64), np.array(values[i]).astype(np.int64))
            if kind.count_type
            else np.array(values[i])
            for i, kind in enumerate(element.properties)
        }

    def guarded(element: Element) -> dict[str, Any]:
        try:
            return take(element)
        except BadMeshError:
            raise
        except (IndexError, OverflowError, ValueError) as error:
            raise BadMeshError("PLY file", f"a line that cannot be read ({error})") from error

    return guarded


def _filled(lines: Iterator[bytes], count: int) -> Iterator[bytes]:
    for _ in range(count):
        row = next((line for line in lines if line.strip()), None)
        if row is None:
            raise BadMeshError("PLY file", "too few lines", hint="it is cut short")
        yield row


def _binary_rows(body: bytes, order: str) -> TakeTable:
    at = 0

    def take(element: Element) -> dict[str, Any]:
        nonlocal at
        try:
            columns, at = _binary_columns(body, at, order, element)
        except (struct.error, ValueError) as error:
            raise BadMeshError("PLY file", error, hint="it is cut short, or broken") from error
        return columns

    return take


def _binary_columns(
    body: bytes, at: int, order: str, element: Element
) -> tuple[dict[str, Any], int]:
    """Read a whole table at once if all its lists are as long as in its first row, else by rows."""
    lengths, _ = _binary_row(body, at, order, element) if element.rows else ({}, at)
    fields: list[Any] = []
    for i, kind in enumerate(element.properties):
        if kind.count_type:
            fields.append((f"count{i}", order + kind.count_type))
        fields.append((f"value{i}", order + kind.type, (len(lengths.get(i, (0,))),)))
    table_type = np.dtype(fields)
    if at + element.rows * table_type.itemsize <= len(body):
        table = np.frombuffer(body, table_type, element.rows, at)
        if all(
            (table[f"count{i}"] == len(lengths[i])).all()
            for i, kind in enumerate(element.properties)
            if kind.count_type and lengths
        ):
            columns = {}
            for i, kind in enumerate(element.properties):
                values = table[f"value{i}"]
                columns[kind.name] = _column(kind, np.full(len(values), values.shape[1]), values)
            return columns, at + element.rows * table_type.itemsize
    rows = []
    for _ in range(element.rows):
        row, at = _binary_row(body, at, order, element)
        rows.append(row)
    return {
        kind.name: _column(
            kind,
            np.array([len(row[i]) for row in rows], np.int64),
            np.array([value for row in rows for value in row[i]]),
        )
        for i, kind in enumerate(element.properties)
    }, at


def _column(kind: Property, sizes: Array, values: Array) -> Any:
    values = values.reshape(-1)
    return (sizes, values.astype(np.int64)) if kind.count_type else values


def _binary_row(
    body: bytes, at: int, order: str, element: Element
) -> tuple[dict[int, tuple[Any, ...]], int]:
    row = {}
    for i, kind in enumerate(element.properties):
        count = 1
        if kind.count_type:
            (count,) = struct.unpack_from(order + _CODES[kind.count_type], body, at)
            at += struct.calcsize(order + _CODES[kind.count_type])
            if not 0 <= count <= len(body):
                raise ValueError(f"a list of {count} values")
        form = f"{order}{int(count)}{_CODES[kind.type]}"
        row[i] = struct.unpack_from(form, body, at)
        at += struct.calcsize(form)
    return row, at
