"""Write the rows of a file to a folder of Parquet or WebDataset files.

Values are those that are stored, except for pictures of 8 bits: these are encoded as sRGB for eyes
and networks, unless the caller asks for linear ones.
"""

import json
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.common.names import check_choice
from scenegen.common.records import check
from scenegen.files.new_file import folder_written_beside
from scenegen.files.rows import RowFile
from scenegen.files.schema import Column
from scenegen.files.sets.shards import cut, shard_name
from scenegen.rendering.ground_truth import undeveloped
from scenegen.rooms.export.formats import DATA_FORMATS
from scenegen.rooms.preview import srgb_bytes
from scenegen.sharing.task import Task, is_picture, stored_blocks

ENCODINGS = ("srgb", "linear")  # of pictures
ROWS_PER_FILE = 1000
MOST_FILES = 100_000  # as many as their numbers of five digits can tell apart
ABOUT = "config.json"  # a name that `datasets` never takes for data
ROW = Column("row", (), "int64", meaning="row of the file that the rows come from")
# Encoding, unit and meaning of pictures.
DECODING = "value times `scale`, decoded by the sRGB curve (IEC 61966-2-1), is linear radiance"
SRGB = "srgb", "sRGB", f"RGB; {DECODING}"
LINEAR = "linear", "linear radiance, times `scale`", "RGB; value times `scale` is linear radiance"


def write_export(
    file: RowFile,
    task: Task,
    form: str,
    folder: str | Path,
    rows: Sequence[int] | None = None,
    *,
    encoding: str = "srgb",
    rows_per_file: int = ROWS_PER_FILE,
    overwrite: bool = False,
    progress: Callable[[int], Any] = lambda done: None,
) -> list[Path]:
    """Write rows of an open file to a folder, which appears when it is complete; return its files.

    Files are called `rooms-00000-of-00003.parquet` after `rooms.h5`, and
    `iqtt-train-labeled-00000-of-00003.parquet` after a part of `iqtt-train.h5`; ABOUT has the root
    attributes of the file that the rows come from, and what each column means. Only what the open
    file tells is written. The same rows give the same bytes with the same versions of Pillow and,
    for Parquet, pyarrow and `datasets`.

    Args:
        form: one of DATA_FORMATS.
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
    part = f", {file.part}" if file.part else ""
    what, count = f"rows of {file.path.name}{part}, {task.what}", len(file)
    check_choice("format", form, DATA_FORMATS)
    check_choice("encoding", encoding, ENCODINGS)
    check(rows_per_file >= 1, "rows per file", rows_per_file, "1 or more")
    check(count > 0, what, "no rows", "at least one")
    chosen = list(range(count) if rows is None else rows)
    good = len(chosen) > 0 and min(chosen) >= 0 and max(chosen) < count
    check(good, "items", f"{len(chosen)} rows", f"some from 0 to {count - 1}")
    check(len(set(chosen)) == len(chosen), "items", "a row twice", "each row once")
    parts = cut(len(chosen), rows_per_file)
    check(len(parts) <= MOST_FILES, "rows per file", rows_per_file, "fewer files than 100,000")
    (ending,), write = DATA_FORMATS[form].endings, DATA_FORMATS[form].load_writer()
    stem = export_stem(file)
    names = [shard_name(f"{stem}{ending}", i, len(parts)) for i in range(len(parts))]
    columns = [ROW, *task.exported(file)]
    changed = [c for c in columns if is_picture(c) and (encoding == "srgb" or _is_developed(c))]
    pictures = {column.name: _codes(column, encoding) for column in changed}
    told = {"srgb": SRGB, "linear": LINEAR}[encoding]
    columns = [_encoded(c, *told) if c.name in pictures else c for c in columns]
    about = {
        "what": f"{what}, as {form}",
        "files": names,
        "columns": {column.name: _told(column) for column in columns},
        "attributes": dict(sorted(file.attributes.items())),
    }
    text = json.dumps(about, indent=1, default=lambda value: np.asarray(value).tolist())
    ours = {*names, ABOUT, *_older_files(folder, stem, ending)}
    with folder_written_beside(folder, ours, overwrite) as made:
        for name, some in zip(names, parts, strict=True):
            blocks = _blocks(file, task, columns, pictures, [chosen[i] for i in some], progress)
            write(made / name, columns, blocks)
        (made / ABOUT).write_text(text + "\n", encoding="utf-8")
    return [Path(folder) / name for name in (*names, ABOUT)]


def export_stem(file: RowFile) -> str:
    """Return what the names of exported files begin with, before their numbers."""
    return "-".join(filter(None, (file.path.stem, file.part)))


def _is_developed(column: Column) -> bool:
    """Return whether a picture is stored as sRGB, as those of interiors are."""
    return column.more.get("encoding") == "sRGB"


def _codes(column: Column, encoding: str) -> NDArray[np.uint8]:
    """Return what each of the 256 values of a picture becomes."""
    levels = np.arange(256, dtype=np.uint8)
    if _is_developed(column):
        return levels if encoding == "srgb" else np.rint(255 * undeveloped(levels)).astype(np.uint8)
    return srgb_bytes(levels / 255) if encoding == "srgb" else levels


def _encoded(column: Column, encoding: str, unit: str, meaning: str) -> Column:
    more = {**column.more, "encoding": encoding}
    return replace(column, unit=unit, meaning=meaning, more=more)


def _told(column: Column) -> dict[str, Any]:
    """Return what the files themselves do not tell of a column."""
    attributes = {key: value for key, value in column.attributes.items() if key != "shape"}
    return {"type": column.dtype, "row_shape": list(column.shape), **attributes}


def _older_files(folder: str | Path, stem: str, ending: str) -> list[str]:
    """Return the names of files that an older export left in a folder, of however many files."""
    pattern = re.compile(rf"{re.escape(stem)}-\d{{5}}-of-\d{{5}}{re.escape(ending)}")
    if not Path(folder).is_dir():
        return []
    return [path.name for path in Path(folder).iterdir() if pattern.fullmatch(path.name)]


def _blocks(
    file: RowFile,
    task: Task,
    columns: Sequence[Column],
    pictures: Mapping[str, NDArray[np.uint8]],
    rows: Sequence[int],
    progress: Callable[[int], Any],
) -> Iterator[dict[str, list[Any]]]:
    """Yield the values of rows as lists, by name of the column; `pictures` get these codes."""
    for block in stored_blocks(file, rows):
        exported = [{ROW.name: row, **task.values(stored)} for row, stored in block]
        for values in exported:
            values.update({n: codes[values[n]] for n, codes in pictures.items()})
        yield {c.name: [values[c.name] for values in exported] for c in columns}
        progress(len(block))
