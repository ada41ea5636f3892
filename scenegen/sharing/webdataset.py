"""Rows as WebDataset: tar archives in which the files of a row follow one another.

The library of that name could write them, too, but it loads torch wherever that is installed.
"""

import io
import json
import tarfile
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from scenegen.files.schema import Column
from scenegen.sharing.stored import is_picture


def write_tar(
    path: Path, columns: Sequence[Column], blocks: Iterable[Mapping[str, Sequence[Any]]]
) -> None:
    """Write blocks of rows, which hold a list of values for each column, to one archive.

    Row 12 of rooms becomes the files `000000012.depth.npy`, `.image.png` (or `.image.npy`, where
    images are floating-point numbers), `.json`, `.normal.npy` and `.object_id.npy`, in this order.
    The JSON has all other columns; numbers keep every bit, and texts are as they are stored.
    Nothing in the archive tells when and by whom it was written.
    """
    with tarfile.open(path, "w", format=tarfile.USTAR_FORMAT) as archive:
        for block in blocks:
            for place, row in enumerate(block["row"]):
                values = {column.name: block[column.name][place] for column in columns}
                for ending, data in sorted(_row_files(columns, values).items()):
                    member = tarfile.TarInfo(f"{row:09d}.{ending}")
                    member.size, member.mode = len(data), 0o644
                    archive.addfile(member, io.BytesIO(data))


def _row_files(columns: Sequence[Column], values: Mapping[str, Any]) -> dict[str, bytes]:
    """Return the files of one row, by their endings."""
    files, small = {}, {}
    for column in columns:
        value, data = values[column.name], io.BytesIO()
        if is_picture(column):
            Image.fromarray(value).save(data, "PNG")
            files[f"{column.name}.png"] = data.getvalue()
        elif column.own_chunk:
            np.save(data, value, allow_pickle=False)
            files[f"{column.name}.npy"] = data.getvalue()
        else:
            small[column.name] = value if column.dtype == "text" else np.asarray(value).tolist()
    files["json"] = json.dumps(small).encode()
    return files
