"""Rows as Parquet files, which `datasets.load_dataset` gives back as images and arrays."""

import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from scenegen.files.schema import Column
from scenegen.sharing.arrow import HUGGING_FACE, PICTURE, feature, field, nested
from scenegen.sharing.columns import is_picture, png_bytes

COMPRESSION = "zstd"


def write_parquet(path: Path, columns: Sequence[Column], blocks: Iterable[dict[str, Any]]) -> None:
    """Write blocks of rows, as `ExportedTable.read` gives them, to one file.

    Each block becomes a row group, so that no more than one is in memory, here and at a reader.
    """
    schema = parquet_schema(columns)
    with pq.ParquetWriter(path, schema, compression=COMPRESSION) as writer:
        for block in blocks:
            arrays = [_array(column, block) for column in columns]
            writer.write_table(pa.Table.from_arrays(arrays, schema=schema))


def parquet_schema(columns: Sequence[Column]) -> pa.Schema:
    """Return the schema of a file: units, frames and meanings in the metadata of its fields."""
    fields, features = [], {}
    for column in columns:
        meaning = {k: v for k, v in column.attributes.items() if k != "shape"}
        if is_picture(column):
            fields.append(pa.field(column.name, PICTURE, metadata=_texts(meaning)))
            features[column.name] = {"_type": "Image"}
        else:
            fields.append(field(column.name, column.shape, column.dtype, meaning))
            told = feature(column.shape, column.dtype)
            features |= {column.name: told} if told else {}
    metadata = {HUGGING_FACE: json.dumps({"info": {"features": features}})}
    return pa.schema(fields, metadata=metadata)


def _array(column: Column, block: dict[str, Any]) -> pa.Array:
    values = block[column.name]
    if is_picture(column):
        pairs = zip(block["row"].tolist(), values, strict=True)
        pictures = [{"bytes": png_bytes(v), "path": f"{row:09d}.png"} for row, v in pairs]
        return pa.array(pictures, PICTURE)
    if column.dtype == "text":
        return pa.array(values)
    return nested(values)


def _texts(meaning: dict[str, Any]) -> dict[str, str]:
    return {key: str(value) for key, value in meaning.items()}
