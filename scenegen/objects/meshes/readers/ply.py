"""PLY files, text and binary of either byte order, as polygons."""

import struct
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.objects.meshes.errors import BadMeshError
from scenegen.objects.meshes.readers.ply_header import Element, Property, read_header
from scenegen.objects.meshes.readers.polygons import Polygons

Array = NDArray[Any]
_CODES = {
    "i1": "b", "u1": "B", "i2": "h", "u2": "H", "i4": "i", "u4": "I", "i8": "q", "u8": "Q",
    "f4": "f", "f8": "d",
}  # fmt: skip


def read_ply(data: bytes) -> Polygons:
    """Read vertices and faces. Raises BadMeshError where the file is broken or has neither."""
    order, elements, body = read_header(data)
    take = _text_rows(body) if not order else _binary_rows(body, order)
    vertices, sizes, corners = None, np.empty(0, np.int64), np.empty(0, np.int64)
    for element in elements:
        columns = take(element)
        if element.name == "vertex":
            if not {"x", "y", "z"} <= set(columns):
                raise BadMeshError("the PLY file's vertices have no x, y and z")
            vertices = np.stack([np.asarray(columns[axis], np.float64) for axis in "xyz"], axis=1)
        elif element.name == "face":
            lists = columns.get("vertex_indices", columns.get("vertex_index"))
            if not isinstance(lists, tuple):
                raise BadMeshError("the PLY file's faces have no list named vertex_indices")
            sizes, corners = lists
        if vertices is not None and len(sizes):
            break
    if vertices is None:
        raise BadMeshError("the PLY file has no vertices")
    return Polygons(vertices, sizes, corners)


Rows = Callable[[Element], dict[str, Any]]  # columns: arrays, or (sizes, values) of lists


def _text_rows(body: bytes) -> Rows:
    lines = iter(body.splitlines())

    def take(element: Element) -> dict[str, Any]:
        values: list[list[float]] = [[] for _ in element.properties]
        sizes: list[list[int]] = [[] for _ in element.properties]
        for row in _filled(lines, element.rows):
            words, at = row.split(), 0
            for column, one in enumerate(element.properties):
                count = int(words[at]) if one.count_type else 1
                at += bool(one.count_type)
                found = words[at : at + count]
                if len(found) != count:
                    raise BadMeshError(f"the PLY file has a line that is too short: {row[:80]!r}")
                values[column].extend(map(float, found))
                sizes[column].append(count)
                at += count
        return {
            one.name: (np.array(sizes[i], np.int64), np.array(values[i]).astype(np.int64))
            if one.count_type
            else np.array(values[i])
            for i, one in enumerate(element.properties)
        }

    def guarded(element: Element) -> dict[str, Any]:
        try:
            return take(element)
        except BadMeshError:
            raise
        except (IndexError, OverflowError, ValueError) as error:
            raise BadMeshError(f"the PLY file has a line that makes no sense: {error}") from error

    return guarded


def _filled(lines: Iterator[bytes], count: int) -> Iterator[bytes]:
    for _ in range(count):
        row = next((line for line in lines if line.strip()), None)
        if row is None:
            raise BadMeshError("the PLY file is cut short")
        yield row


def _binary_rows(body: bytes, order: str) -> Rows:
    at = 0

    def take(element: Element) -> dict[str, Any]:
        nonlocal at
        try:
            columns, at = _binary_columns(body, at, order, element)
        except (struct.error, ValueError) as error:
            raise BadMeshError(f"the PLY file is cut short or broken: {error}") from error
        return columns

    return take


def _binary_columns(
    body: bytes, at: int, order: str, element: Element
) -> tuple[dict[str, Any], int]:
    """Read a table at once where all its lists are as long as in the first row, else by rows."""
    lengths, _ = _binary_row(body, at, order, element) if element.rows else ({}, at)
    fields: list[Any] = []
    for i, one in enumerate(element.properties):
        if one.count_type:
            fields.append((f"count{i}", order + one.count_type))
        fields.append((f"value{i}", order + one.type, (len(lengths.get(i, (0,))),)))
    table_type = np.dtype(fields)
    if at + element.rows * table_type.itemsize <= len(body):
        table = np.frombuffer(body, table_type, element.rows, at)
        if all(
            (table[f"count{i}"] == len(lengths[i])).all()
            for i, one in enumerate(element.properties)
            if one.count_type and lengths
        ):
            columns = {}
            for i, one in enumerate(element.properties):
                values = table[f"value{i}"]
                columns[one.name] = _column(one, np.full(len(values), values.shape[1]), values)
            return columns, at + element.rows * table_type.itemsize
    rows = []
    for _ in range(element.rows):
        row, at = _binary_row(body, at, order, element)
        rows.append(row)
    return {
        one.name: _column(
            one,
            np.array([len(row[i]) for row in rows], np.int64),
            np.array([value for row in rows for value in row[i]]),
        )
        for i, one in enumerate(element.properties)
    }, at


def _column(one: Property, sizes: Array, values: Array) -> Any:
    values = values.reshape(-1)
    return (sizes, values.astype(np.int64)) if one.count_type else values


def _binary_row(
    body: bytes, at: int, order: str, element: Element
) -> tuple[dict[int, tuple[Any, ...]], int]:
    row = {}
    for i, one in enumerate(element.properties):
        count = 1
        if one.count_type:
            (count,) = struct.unpack_from(order + _CODES[one.count_type], body, at)
            at += struct.calcsize(order + _CODES[one.count_type])
            if not 0 <= count <= len(body):
                raise ValueError(f"a list of {count} values")
        form = f"{order}{int(count)}{_CODES[one.type]}"
        row[i] = struct.unpack_from(form, body, at)
        at += struct.calcsize(form)
    return row, at
