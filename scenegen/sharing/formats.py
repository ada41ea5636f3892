"""Blocks of rows as Parquet files, with the types of `datasets`, and as WebDataset archives.

The library WebDataset could write archives, too, but it loads torch wherever that is installed.
"""

import io
import json
import tarfile
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from scenegen.files.schema import Column
from scenegen.sharing.task import is_picture

Blocks = Iterable[Mapping[str, Sequence[Any]]]  # each with a list of values for each column


def write_parquet(
    path: Path, columns: Sequence[Column], blocks: Blocks, arrays: bool = True
) -> None:
    """Write blocks of rows to one file.

    Each block becomes a row group, so that no more than one is in memory, here and at a reader.

    Args:
        columns: -1 in a shape stands for any length.
        arrays: whether values of two axes or more are arrays of `datasets`, or plain lists, which
            every reader of Parquet knows.
    """
    import pyarrow.parquet as pq
    from datasets import Dataset, Features

    types = Features({column.name: _feature(column, arrays) for column in columns})
    with pq.ParquetWriter(path, types.arrow_schema, compression="zstd") as writer:
        for block in blocks:
            writer.write_table(Dataset.from_dict(dict(block), types).data.table)


def _feature(column: Column, arrays: bool) -> Any:
    from datasets import Image, List, Value
    from datasets.features import Array2D, Array3D, Array4D, Array5D

    kinds = {2: Array2D, 3: Array3D, 4: Array4D, 5: Array5D}
    if is_picture(column):
        return Image()
    if arrays and len(column.shape) in kinds and min(column.shape) > 0:
        return kinds[len(column.shape)](column.shape, column.dtype)
    kind: Any = Value("string" if column.dtype == "text" else column.dtype)
    for _ in column.shape:
        kind = List(kind)
    return kind


def write_tar(path: Path, columns: Sequence[Column], blocks: Blocks) -> None:
    """Write blocks of rows to one archive, in which the files of a row follow one another.

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
    from PIL import Image

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
