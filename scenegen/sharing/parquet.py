"""Columns of rows as Parquet files, with the types of `datasets`."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
from datasets import Dataset, Features, Image, List, Value
from datasets.features import Array2D, Array3D, Array4D, Array5D

from scenegen.files.schema import Column
from scenegen.sharing.stored import is_picture

ARRAYS = {2: Array2D, 3: Array3D, 4: Array4D, 5: Array5D}


def write_parquet(
    path: Path,
    columns: Sequence[Column],
    blocks: Iterable[Mapping[str, Sequence[Any]]],
    arrays: bool = True,
) -> None:
    """Write blocks of rows, which hold a list of values for each column, to one file.

    Each block becomes a row group, so that no more than one is in memory, here and at a reader.

    Args:
        columns: -1 in a shape stands for any length.
        arrays: whether values of two axes or more are arrays of `datasets`, or plain lists, which
            every reader of Parquet knows.
    """
    types = Features({column.name: _feature(column, arrays) for column in columns})
    with pq.ParquetWriter(path, types.arrow_schema, compression="zstd") as writer:
        for block in blocks:
            writer.write_table(Dataset.from_dict(dict(block), types).data.table)


def _feature(column: Column, arrays: bool) -> Any:
    if is_picture(column):
        return Image()
    if arrays and len(column.shape) in ARRAYS and min(column.shape) > 0:
        return ARRAYS[len(column.shape)](column.shape, column.dtype)
    kind: Any = Value("string" if column.dtype == "text" else column.dtype)
    for _ in column.shape:
        kind = List(kind)
    return kind
