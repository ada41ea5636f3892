"""Write the rows of a file to a folder of Parquet or WebDataset files.

Values are those that are stored, except for pictures of 8 bits: these are encoded as sRGB for eyes
and networks, unless the caller asks for linear ones.
"""

import json
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from scenegen.common.names import check_choice
from scenegen.common.records import check
from scenegen.files.new_file import folder_written_beside
from scenegen.files.rows import RowFile
from scenegen.files.schema import Column
from scenegen.files.sets.shards import cut, shard_name
from scenegen.rooms.preview import srgb_bytes
from scenegen.sharing.stored import as_text, is_picture, stored_blocks

FORMATS = {"parquet": ".parquet", "webdataset": ".tar"}  # and how the names of their files end
ENCODINGS = ("srgb", "linear")  # of pictures
ROWS_PER_FILE = 1000
MOST_FILES = 100_000  # as many as their numbers of five digits can tell apart
ABOUT = "config.json"  # a name that `datasets` never takes for data
ROW = Column("row", (), "int64", meaning="row of the file that the rows come from")


@dataclass(frozen=True)
class ExportedTable:
    """Rows to write.

    Attributes:
        stem: how the names of the files begin.
        what: what the rows are, in words of ours.
        file: where they are stored.
        columns: of each row, besides `ROW`.
        values: returns the values of these columns from those that are stored, of one row.
    """

    stem: str
    what: str
    file: RowFile
    columns: Sequence[Column]
    values: Callable[[Mapping[str, Any]], Mapping[str, Any]]


def write_export(
    table: ExportedTable,
    form: str,
    folder: str | Path,
    rows: Sequence[int] | None = None,
    *,
    encoding: str = "srgb",
    rows_per_file: int = ROWS_PER_FILE,
    overwrite: bool = False,
    progress: Callable[[int], Any] = lambda done: None,
) -> list[Path]:
    """Write rows of a table to a folder, which appears when it is complete; return its files.

    Files are called `rooms-00000-of-00003.parquet` after the stem; ABOUT has the root attributes
    of the file that the rows come from, and what each column means. The same rows give the same
    bytes with the same versions of Pillow and, for Parquet, pyarrow and `datasets`.

    Args:
        form: one of FORMATS.
        folder: to make; with `overwrite`, an older one of such files is replaced.
        rows: which to write, in this order; all by default.
        encoding: one of ENCODINGS, of pictures. Images of floating-point numbers stay linear.
        rows_per_file: the most rows of one file.
        progress: is told the number of rows that were written since the last call.

    Raises:
        OSError: as `folder_written_beside`.
        SpecError: no rows, rows out of range or twice; too many files.
        FileFormatError: a row is damaged.
    """
    count = len(table.file)
    check_choice("format", form, FORMATS)
    check_choice("encoding", encoding, ENCODINGS)
    check(rows_per_file >= 1, "rows per file", rows_per_file, "1 or more")
    check(count > 0, table.what, "no rows", "at least one")
    chosen = list(range(count) if rows is None else rows)
    good = len(chosen) > 0 and min(chosen) >= 0 and max(chosen) < count
    check(good, "items", f"{len(chosen)} rows", f"some from 0 to {count - 1}")
    check(len(set(chosen)) == len(chosen), "items", "a row twice", "each row once")
    parts = cut(len(chosen), rows_per_file)
    check(len(parts) <= MOST_FILES, "rows per file", rows_per_file, "fewer files than 100,000")
    ending = FORMATS[form]
    names = [shard_name(f"{table.stem}{ending}", i, len(parts)) for i in range(len(parts))]
    ours = {*names, ABOUT, *_older_files(folder, table.stem, ending)}
    write = _writer(form)
    if encoding == "srgb":
        table = _for_eyes(table)
    with folder_written_beside(folder, ours, overwrite) as made:
        for name, part in zip(names, parts, strict=True):
            blocks = _blocks(table, [chosen[i] for i in part], progress)
            write(made / name, (ROW, *table.columns), blocks)
        (made / ABOUT).write_text(_about(table, form, names), encoding="utf-8")
    return [Path(folder) / name for name in (*names, ABOUT)]


def _for_eyes(table: ExportedTable) -> ExportedTable:
    """Return a table whose pictures are encoded as sRGB, and whose columns say so."""
    codes = srgb_bytes(np.arange(256) / 255)
    pictures = [column.name for column in table.columns if is_picture(column)]
    how = "value times `scale`, decoded by the sRGB curve (IEC 61966-2-1), is linear radiance"

    def described(column: Column) -> Column:
        if column.name not in pictures:
            return column
        more = {**column.more, "encoding": "srgb"}
        return replace(column, unit="sRGB", meaning=f"RGB; {how}", more=more)

    def values(stored: Mapping[str, Any]) -> Mapping[str, Any]:
        exported = table.values(stored)
        return {**exported, **{name: codes[exported[name]] for name in pictures}}

    return replace(table, columns=[described(column) for column in table.columns], values=values)


def _older_files(folder: str | Path, stem: str, ending: str) -> list[str]:
    """Return the names of files that an older export left in a folder, of however many files."""
    pattern = re.compile(rf"{re.escape(stem)}-\d{{5}}-of-\d{{5}}{re.escape(ending)}")
    if not Path(folder).is_dir():
        return []
    return [path.name for path in Path(folder).iterdir() if pattern.fullmatch(path.name)]


def _writer(form: str) -> Callable[..., None]:
    """Return the writer of a format; only Parquet needs libraries of its own."""
    if form == "parquet":
        from scenegen.sharing.parquet import write_parquet

        return write_parquet
    from scenegen.sharing.webdataset import write_tar

    return write_tar


def _blocks(
    table: ExportedTable, rows: Sequence[int], progress: Callable[[int], Any]
) -> Iterator[dict[str, list[Any]]]:
    """Yield the values of rows as lists, by name of the column."""
    file = table.file
    for numbers, stored in stored_blocks(file, rows):
        block: dict[str, list[Any]] = {ROW.name: numbers}
        for row, values in zip(numbers, stored, strict=True):
            texts = {name: as_text(value, file.place(name, row)) for name, value in values.items()}
            exported = table.values(texts)
            for column in table.columns:
                block.setdefault(column.name, []).append(exported[column.name])
        yield block
        progress(len(numbers))


def _about(table: ExportedTable, form: str, names: Sequence[str]) -> str:
    """Return what the files do not tell themselves, as JSON."""
    columns = {
        c.name: {
            "type": c.dtype,
            "row_shape": list(c.shape),
            **{key: value for key, value in c.attributes.items() if key != "shape"},
        }
        for c in (ROW, *table.columns)
    }
    about = {
        "what": f"{table.what}, as {form}",
        "files": list(names),
        "columns": columns,
        "attributes": dict(sorted(table.file.attributes.items())),
    }
    return json.dumps(about, indent=1, default=lambda value: np.asarray(value).tolist()) + "\n"
