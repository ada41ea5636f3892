"""Arrow arrays and fields of what NumPy holds, in the form that `datasets` knows as its own."""

import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

Array = NDArray[Any]
PICTURE = pa.struct([("bytes", pa.binary()), ("path", pa.string())])  # as `datasets.Image` has it
HUGGING_FACE = "huggingface"  # the key under which `datasets` looks for types in a schema


def nested(values: Array) -> pa.Array:
    """Return an array (rows, ...) as an Arrow array of lists of lists; every bit is kept."""
    values = np.ascontiguousarray(values)
    found, count = pa.array(values.reshape(-1)), values.size
    for size in reversed(values.shape[1:]):
        starts = pa.array(np.arange(0, count + 1, size, dtype=np.int32))
        found, count = pa.ListArray.from_arrays(starts, found), count // size
    return found


def field(name: str, row_shape: Sequence[int], dtype: str, meaning: Mapping[str, Any]) -> pa.Field:
    """Return a column's field: lists as deep as a row's shape, of numbers or texts.

    Where a row has two axes or more, all of known lengths, the field says so in the way of
    `datasets`, which then gives arrays back; -1 stands for any length. `meaning` becomes the
    field's metadata.
    """
    kind = pa.string() if dtype == "text" else pa.from_numpy_dtype(np.dtype(dtype))
    for _ in row_shape:
        kind = pa.list_(kind)
    metadata = {key: str(value) for key, value in meaning.items()}
    if len(row_shape) >= 2 and min(row_shape) > 0:
        name_of_type = f"datasets.features.features.Array{len(row_shape)}DExtensionType"
        metadata["ARROW:extension:name"] = name_of_type
        metadata["ARROW:extension:metadata"] = json.dumps([list(row_shape), dtype])
    return pa.field(name, kind, metadata=metadata)


def feature(row_shape: Sequence[int], dtype: str) -> dict[str, Any] | None:
    """Return the type of a column as `datasets` writes it; None where Arrow's own says it all."""
    if len(row_shape) < 2:
        return None
    kind = f"Array{len(row_shape)}D"
    return {"shape": list(row_shape), "dtype": dtype, "_type": kind}
