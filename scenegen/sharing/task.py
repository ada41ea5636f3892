"""What exports and cards tell of a kind of rows. There are two: rooms, and `iqtt`'s questions."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from scenegen.common.errors import FileFormatError
from scenegen.files.rows import RowBlock, RowFile
from scenegen.files.schema import Column
from scenegen.files.sets.shards import cut

BLOCK_BYTES = 2**25  # of rows that are in memory at once
Line = dict[str, Any]  # of an index, by column
# Paragraphs on all data that this program makes, by the same names.
ALL_DATA: dict[str, str | list[str]] = {
    "data_collection_type": ["Software Collection"],
    "data_social_impact": "None is expected: the images show no people, and nothing that exists.",
    "data_release_maintenance_plan": "A file is not changed after it is published; a correction"
    " gets a new version and new SHA-256s.",
}


@dataclass
class Tally:
    """What the rows of one table hold: their number, what was counted, and how many differ.

    Attributes:
        digests: of what the rows show, as hex.
    """

    rows: int = 0
    counters: dict[str, Counter[Any]] = field(default_factory=dict)
    digests: set[str] = field(default_factory=set)


@dataclass(frozen=True)
class Task:
    """What is told of rows of one kind. All texts are ours; `Any` is an open file of such rows.

    Attributes:
        unit: what the rows are, in one word.
        what: a file of them.
        verify: command that tells which rows of a file were changed.
        summary: what the data is, in one paragraph.
        keywords: words to find it by.
        responsible: paragraphs by mlcroissant's names of the fields of RAI, besides ALL_DATA.
        reading: how the files are read, for people.
        exported: returns the columns of an export.
        values: returns their values from those that are stored, of one row.
        columns: of a line of the index, besides places and digests; -1 in a shape stands for any
            length.
        key: names of columns of the index that together name a row.
        line: returns the values of `columns` from a file and the stored values of a row.
        digested: columns of the files whose rows' SHA-256 is in a line.
        same: that of them which rows share that show the same.
        counts: by title, what to count of a line; a line may count several times, or not at all.
        facts: returns what a card tells of a file and its tally, by title.
        layout: returns a Markdown table of the data sets of some files, with units and frames.
    """

    unit: str
    what: str
    verify: str
    summary: str
    keywords: Sequence[str]
    responsible: Mapping[str, str | list[str]]
    reading: str
    exported: Callable[[Any], Sequence[Column]]
    values: Callable[[Mapping[str, Any]], Mapping[str, Any]]
    columns: Sequence[Column]
    key: Sequence[str]
    line: Callable[[Any, Mapping[str, Any]], Line]
    digested: Sequence[str]
    same: str
    counts: Mapping[str, Callable[[Line], Iterable[Any]]]
    facts: Callable[[Any, Tally], Mapping[str, str]]
    layout: Callable[[Sequence[Any]], str]


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
