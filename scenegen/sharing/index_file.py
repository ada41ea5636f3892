"""The file of an index: Parquet with a line for each row of some files, whatever they hold."""

from collections.abc import Iterable, Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from scenegen.sharing.arrow import field as arrow_field
from scenegen.sharing.description import IndexColumn

GROUP_ROWS = 1000  # of a row group


def write_lines(
    path: Path, columns: Sequence[IndexColumn], lines: Iterable[dict[str, Any]]
) -> None:
    """Write the lines of an index; each has a value for every column, None where it has none."""
    schema = index_schema(columns)
    with pq.ParquetWriter(path, schema, compression="zstd") as writer:
        for group in _in_groups(iter(lines)):
            writer.write_table(pa.Table.from_pylist(group, schema=schema))


def index_schema(columns: Sequence[IndexColumn]) -> pa.Schema:
    """Return the schema of an index: plain lists, as any reader of Parquet knows them."""
    return pa.schema(
        arrow_field(c.name, (-1,) * len(c.shape), _dtype(c), {"meaning": c.meaning})
        for c in columns
    )


def _dtype(column: IndexColumn) -> str:
    return "text" if column.kind == "Text" else column.kind.lower()


def _in_groups(lines: Iterator[dict[str, Any]]) -> Iterator[list[dict[str, Any]]]:
    while group := list(islice(lines, GROUP_ROWS)):
        yield group
