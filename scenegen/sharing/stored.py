"""The rows of an open file as they are stored, whatever they are about."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from scenegen.common.errors import FileFormatError
from scenegen.files.rows import RowBlock, RowFile
from scenegen.files.schema import Column
from scenegen.files.sets.shards import cut

BLOCK_BYTES = 2**25  # of rows that are in memory at once


def is_picture(column: Column) -> bool:
    """Return whether a column's values are handed on as PNG files: images of 8 bits a channel."""
    return column.own_chunk and column.dtype == "uint8" and column.shape[2:] == (3,)


def stored_blocks(
    file: RowFile, rows: Sequence[int]
) -> Iterator[tuple[list[int], list[dict[str, Any]]]]:
    """Yield some rows and the stored values of each by column, as many as fit into BLOCK_BYTES.

    Raises FileFormatError where a row is damaged.
    """
    if not len(rows):
        return
    size = sum(np.asarray(file.read(name, rows[0])).nbytes for name in file.fields)
    for part in cut(len(rows), max(1, BLOCK_BYTES // size)):
        numbers = [rows[i] for i in part]
        block = RowBlock(file, range(numbers[0], numbers[0] + len(numbers)))
        yield numbers, [{name: block.read(name, row) for name in file.fields} for row in numbers]


def as_text(value: Any, place: str) -> Any:
    """Return stored texts as `str`, or as lists of them, and any other value as it is.

    Raises FileFormatError, naming the place, for a text that is not UTF-8.
    """
    if isinstance(value, np.ndarray) and value.dtype.kind in "OS":
        return [as_text(part, place) for part in value]
    if not isinstance(value, bytes):
        return value
    try:
        return value.decode()
    except UnicodeDecodeError as error:
        raise FileFormatError(place, f"{value!r:.60}", "UTF-8") from error
