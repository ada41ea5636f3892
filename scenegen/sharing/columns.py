"""Rows of a file of rooms as named columns: what every exported format holds."""

import io
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from scenegen.common.errors import FileFormatError
from scenegen.common.hdf5.table import Column
from scenegen.description.specs import DatasetSpec
from scenegen.layout import columns
from scenegen.rooms.reader import RoomsFile

Array = NDArray[Any]
ROW = Column(
    "row",
    (),
    "int64",
    attributes={"unit": "1", "frame": "-", "meaning": "row of the file of rooms"},
)
PNG_LEVEL = 6  # of deflate


def column_name(dataset: str) -> str:
    """Return the name of a dataset's column: `camera/fov_y_degrees` is `camera_fov_y_degrees`."""
    return dataset.replace("/", "_")


def exported_columns(spec: DatasetSpec) -> list[Column]:
    """Return the columns of rows that answer a request: `row`, then a column for each dataset."""
    return [ROW, *(replace(c, name=column_name(c.name)) for c in columns(spec))]


def read_rows(rooms: RoomsFile, rows: Sequence[int]) -> dict[str, Any]:
    """Read some rows; return their values by name of the column, in the order of `rows`.

    Numbers are arrays (rows, ...) of the types that are stored, texts are `str`, or lists of them.

    Raises IndexError, and FileFormatError where a row is damaged.
    """
    in_order = list(rows) == list(range(rows[0], rows[0] + len(rows)))
    found: dict[str, Any] = {ROW.name: np.array(rows, np.int64)}
    for column in columns(rooms.spec):
        if in_order and not column.own_chunk:
            values = rooms.read(column.name, slice(rows[0], rows[0] + len(rows)))
        else:
            values = [rooms.read(column.name, row) for row in rows]
        if column.dtype == "text":
            place = f"{rooms.path}: {column.name}"
            pairs = zip(rows, values, strict=True)
            texts = [decoded(value, f"{place}, row {row}") for row, value in pairs]
            found[column_name(column.name)] = texts
        else:
            found[column_name(column.name)] = np.asarray(values)
    return found


def is_picture(column: Column) -> bool:
    """Return whether a column's values are stored as PNG files: images of 8 bits a channel."""
    return column.name == "image" and column.dtype == "uint8"


def png_bytes(image: Array) -> bytes:
    """Return an image, (H, W, 3) uint8, as a PNG file, which keeps every value."""
    file = io.BytesIO()
    Image.fromarray(image).save(file, "PNG", compress_level=PNG_LEVEL)
    return file.getvalue()


def meanings(spec: DatasetSpec) -> dict[str, Mapping[str, Any]]:
    """Return type, shape, unit, frame and meaning of each column, ready for JSON."""
    return {
        c.name: {"type": c.dtype, "row_shape": list(c.shape)}
        | {key: value for key, value in c.attributes.items() if key != "shape"}
        for c in exported_columns(spec)
    }


def decoded(value: Any, place: str) -> Any:
    """Return a stored text, or an array of them as a list, as `str`.

    Raises FileFormatError, naming the place, where it is not UTF-8.
    """
    if not isinstance(value, bytes):
        return [decoded(part, place) for part in value]
    try:
        return value.decode()
    except UnicodeDecodeError as error:
        raise FileFormatError(place, f"{value!r:.60}", "UTF-8") from error
