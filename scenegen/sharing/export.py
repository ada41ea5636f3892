"""Write rows of rooms to a folder of Parquet or WebDataset files, each value as it is stored."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from scenegen.description.specs import DatasetSpec
from scenegen.files.schema import Column
from scenegen.layout import columns
from scenegen.rooms.reader import RoomsFile
from scenegen.sharing.columns import column_name, decoded, row_column
from scenegen.sharing.folder import ROWS_PER_FILE, ExportedTable, write_folder

ROW = row_column("row of the file of rooms")


def export_rows(
    path: str | Path,
    form: str,
    folder: str | Path,
    rows: Sequence[int] | None = None,
    *,
    rows_per_file: int = ROWS_PER_FILE,
    overwrite: bool = False,
    progress: Callable[[int], Any] = lambda done: None,
) -> list[Path]:
    """Write rows of a file of rooms, or of a set of shards, as `write_folder`; return its files.

    Files are called `rooms-00000-of-00003.parquet` after `rooms.h5`.

    Raises as `write_folder`; and OSError where there is no such file, FileFormatError where it is
    not one of rooms, or a row is damaged.
    """
    with RoomsFile(path) as rooms:
        table = ExportedTable(
            stem=Path(path).stem,
            what=f"rows of {rooms.path.name}, a file of rooms of pix2shape-bench",
            columns=exported_columns(rooms.spec),
            count=len(rooms),
            read=partial(read_rows, rooms),
            attributes=rooms.attributes,
        )
        return write_folder(
            table,
            form,
            folder,
            rows,
            rows_per_file=rows_per_file,
            overwrite=overwrite,
            progress=progress,
        )


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
