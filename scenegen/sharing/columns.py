"""Named columns of rows, whatever they are about: what every exported format holds."""

import io
from collections.abc import Mapping, Sequence
from typing import Any

from numpy.typing import NDArray
from PIL import Image

from scenegen.common.errors import FileFormatError
from scenegen.files.schema import Column

Array = NDArray[Any]
PNG_LEVEL = 6  # of deflate


def column_name(dataset: str) -> str:
    """Return the name of a dataset's column: `camera/fov_y_degrees` is `camera_fov_y_degrees`."""
    return dataset.replace("/", "_")


def row_column(meaning: str) -> Column:
    """Return the column `row`, which comes first, with the number of each row in its file."""
    return Column("row", (), "int64", meaning=meaning)


def is_picture(column: Column) -> bool:
    """Return whether a column's values are stored as PNG files: images of 8 bits a channel."""
    return column.own_chunk and column.dtype == "uint8" and column.shape[2:] == (3,)


def png_bytes(image: Array) -> bytes:
    """Return an image, (H, W, 3) uint8, as a PNG file, which keeps every value."""
    file = io.BytesIO()
    Image.fromarray(image).save(file, "PNG", compress_level=PNG_LEVEL)
    return file.getvalue()


def meanings(columns: Sequence[Column]) -> dict[str, Mapping[str, Any]]:
    """Return type, shape, unit, frame and meaning of each column, ready for JSON."""
    return {
        c.name: {"type": c.dtype, "row_shape": list(c.shape)}
        | {key: value for key, value in c.attributes.items() if key != "shape"}
        for c in columns
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
