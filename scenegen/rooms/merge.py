"""Make one file of a set of shards."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from scenegen.common.errors import FileFormatError
from scenegen.files.content import SHA256
from scenegen.files.table import Rows, pack_rows, packing_threads
from scenegen.files.workers import in_threads
from scenegen.layout import FIELDS, columns
from scenegen.rendering.backend import VERSION_ATTRIBUTES
from scenegen.rooms.reader import RoomsFile
from scenegen.rooms.writer import create_rooms

STEP = 16  # rows that are read and packed in one go
COPIED = ("creation_command", "variant", *VERSION_ATTRIBUTES)


def merge_rooms(
    path: str | Path,
    out: str | Path,
    overwrite: bool = False,
    progress: Callable[[int], Any] = lambda done: None,
) -> None:
    """Write the rows of a file of rooms, or of a set of shards, to one file.

    It has the bytes that the command which made the set would have written to one file.

    Raises as `RoomsFile` and `create_rooms`, and FileFormatError where a value is not the one that
    was written to its shard; nothing is then left.
    """
    with RoomsFile(path) as rooms:
        fields, views = columns(rooms.spec), len(rooms.spec.views)
        compression = rooms.compression()
        attributes = {name: str(rooms.attributes[name]) for name in COPIED}
        with create_rooms(
            out, rooms.spec, len(rooms) // views, compression=compression, overwrite=overwrite,
            attributes=attributes,
        ) as writer:  # fmt: skip
            pieces = _pieces(rooms, STEP * views)
            threads = packing_threads()
            packed = in_threads(
                lambda rows: pack_rows(rows, fields, compression), pieces, threads, 4 * threads
            )
            for rows in packed:
                writer.extend(rows)
                progress(rows.count)
            told = rooms.stored_digests()
            for name, dataset in writer.table.datasets.items():
                if dataset.attrs[SHA256] != told[name]:
                    found = f"values of {name} that are not those which were written"
                    raise FileFormatError(path, found, "", "scenegen verify tells which")


def _pieces(rooms: RoomsFile, step: int) -> Iterator[Rows]:
    for first in range(0, len(rooms), step):
        some = slice(first, min(first + step, len(rooms)))
        rows = {field.name: rooms.read(field.name, some) for field in FIELDS}
        for field in FIELDS:
            if field.dtype == "text":
                values = rows[field.name]
                texts = [text.decode() for text in values.ravel().tolist()]
                rows[field.name] = np.array(texts, object).reshape(values.shape)
        yield rows
