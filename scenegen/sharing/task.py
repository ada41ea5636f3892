"""What is exported of a kind of rows. There are two: rooms, and `iqtt`'s questions."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from scenegen.common.errors import FileFormatError
from scenegen.files.rows import RowBlock, RowFile
from scenegen.files.schema import Column
from scenegen.files.sets.shards import cut

BLOCK_BYTES = 2**25  # of rows that are in memory at once


@dataclass(frozen=True)
class Task:
    """What is exported of rows of one kind; `Any` is an open file of such rows.

    Attributes:
        what: a file of them, in words of ours.
        exported: returns the columns of an export.
        values: returns their values from those that are stored, of one row.
    """

    what: str
    exported: Callable[[Any], Sequence[Column]]
    values: Callable[[Mapping[str, Any]], Mapping[str, Any]]


def is_picture(column: Column) -> bool:
    """Return whether a column's values are handed on as PNG files: images of 8 bits a channel."""
    return column.own_chunk and column.dtype == "uint8" and column.shape[2:] == (3,)


def stored_blocks(file: RowFile, rows: Sequence[int]) -> Iterator[list[tuple[int, dict[str, Any]]]]:
    """Yield some rows and the stored values of each by column, as many as fit into BLOCK_BYTES.

    Texts come as `str`. Raises FileFormatError where a row is damaged, or a text is not UTF-8.
    """
    if not len(rows):
        return
    size = sum(np.asarray(file.read(name, rows[0])).nbytes for name in file.fields)
    for part in cut(len(rows), max(1, BLOCK_BYTES // size)):
        numbers = [rows[i] for i in part]
        block = RowBlock(file, range(numbers[0], numbers[0] + len(numbers)))
        yield [
            (row, {n: _as_text(block.read(n, row), file.place(n, row)) for n in file.fields})
            for row in numbers
        ]


def _as_text(value: Any, place: str) -> Any:
    """Return stored texts as `str`, or as lists of them, and any other value as it is."""
    if isinstance(value, np.ndarray) and value.dtype.kind in "OS":
        return [_as_text(part, place) for part in value]
    if not isinstance(value, bytes):
        return value
    try:
        return value.decode()
    except UnicodeDecodeError as error:
        raise FileFormatError(place, f"{value!r:.60}", "UTF-8") from error
