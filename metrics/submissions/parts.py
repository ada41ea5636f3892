"""Parts of a submission, checked and written: texts, arrays, and datasets that fit into memory."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import ArrayLike, NDArray

from metrics.submissions.layout import (
    ATTRIBUTES,
    FORMAT_NAME,
    FORMAT_VERSION,
    attributes,
    datasets,
    text_fault,
)
from metrics.submissions.problems import PredictionError
from scenegen.common.row_file import writer_name

Array = NDArray[Any]


def check_elsewhere(path: str | Path, truth: str | Path) -> None:
    """Raise PredictionError where a submission would replace what it is about."""
    if os.path.exists(path) and os.path.exists(truth) and os.path.samefile(path, truth):
        raise PredictionError(f"{path}: is the file that is predicted; write to another one")


def checked_texts(task: str, given: Mapping[str, str]) -> dict[str, str]:
    """Return the root attributes, but for the fingerprint. Raises PredictionError."""
    ours = {
        "format": FORMAT_NAME,
        "format_version": FORMAT_VERSION,
        "task": task,
        "writer": writer_name(),
    }
    for attribute in attributes(task):
        text = given.get(attribute.name, "")
        if attribute.name in given and not isinstance(text, str):
            raise PredictionError(f"{attribute.name}: found {text!r:.40}, expected a text")
        fault = text_fault(attribute, text) if attribute.name in given else None
        if fault is not None:
            raise PredictionError(f"{attribute.name}: found {fault[0]}, expected {fault[1]}")
    texts = {**ours, **given}
    return {a.name: texts[a.name] for a in ATTRIBUTES if a.name in texts}


def checked_floats(
    values: ArrayLike, shape: tuple[int, ...], where: str, dtype: type[Any] = np.float32
) -> Array:
    """The array as it is stored. Raises PredictionError for another shape, or no floats."""
    try:
        array = np.asarray(values)
    except Exception as error:
        what = f"{type(values).__name__}, which is no array ({error!s:.80})"
        raise PredictionError(f"{where}: found {what}, expected floats {shape}") from error
    if array.shape != shape:
        raise PredictionError(f"{where}: found shape {array.shape}, expected {shape}")
    if array.dtype.kind != "f":
        raise PredictionError(f"{where}: found type {array.dtype}, expected floats")
    with np.errstate(over="ignore", invalid="ignore"):  # what overflows is refused as infinite
        return array.astype(dtype)


def write_columns(file: h5py.File, task: str, values: Mapping[str, Array]) -> None:
    """Write datasets that are small enough to be kept in memory."""
    for dataset in datasets(task):
        if dataset.name in values:
            data = values[dataset.name].astype(dataset.dtype)
            stored = file.create_dataset(
                dataset.name, data=data, compression="gzip", shuffle=data.itemsize > 1
            )
            stored.attrs.update(dataset.attributes)
