"""Rows as WebDataset: tar archives in which the files of a row follow one another."""

import io
import json
import tarfile
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.files.schema import Column
from scenegen.sharing.columns import is_picture, png_bytes

Array = NDArray[Any]


def write_tar(path: Path, columns: Sequence[Column], blocks: Iterable[dict[str, Any]]) -> None:
    """Write blocks of rows, as `ExportedTable.read` gives them, to one archive.

    Row 12 of rooms becomes the files `000000012.depth.npy`, `.image.png` (or `.image.npy`, where
    images are floating-point numbers), `.json`, `.normal.npy` and `.object_id.npy`, in this order.
    The JSON has all other columns; numbers keep every bit, and texts are as they are stored.
    Nothing in the archive tells when and by whom it was written.
    """
    with tarfile.open(path, "w", format=tarfile.USTAR_FORMAT) as archive:
        for block in blocks:
            for place, row in enumerate(block["row"].tolist()):
                values = {column.name: block[column.name][place] for column in columns}
                for ending, data in sorted(row_files(columns, values).items()):
                    member = tarfile.TarInfo(f"{row:09d}.{ending}")
                    member.size, member.mode = len(data), 0o644
                    archive.addfile(member, io.BytesIO(data))


def row_files(columns: Sequence[Column], values: dict[str, Any]) -> dict[str, bytes]:
    """Return the files of one row, by their endings."""
    files, small = {}, {}
    for column in columns:
        value = values[column.name]
        if is_picture(column):
            files[f"{column.name}.png"] = png_bytes(value)
        elif column.own_chunk:
            files[f"{column.name}.npy"] = npy_bytes(value)
        else:
            small[column.name] = value if column.dtype == "text" else np.asarray(value).tolist()
    files["json"] = json.dumps(small).encode()
    return files


def npy_bytes(values: Array) -> bytes:
    """Return an array as a .npy file."""
    file = io.BytesIO()
    np.save(file, values, allow_pickle=False)
    return file.getvalue()
