"""What a kind of file holds: columns with one entry a row, and texts at the root of the file.

Rooms, questions and predictions are each such a schema, and what only they do.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import h5py
import numpy as np

from scenegen.common.records import LONGEST_JSON
from scenegen.files.content import SHA256, dataset_digest

DIGEST = "[0-9a-f]{64}"  # SHA-256 as hex


@dataclass(frozen=True)
class Column:
    """A data set with one entry a row.

    Attributes:
        shape: of a row.
        dtype: NumPy name, or "text" for UTF-8 strings.
        unit, frame, meaning: HDF5 attributes.
        axes: names of a row's axes (`name_axes`), or None; the axis of rows is called "row".
        own_chunk: whether each row is a compressed chunk of its own, as images are.
        shuffle: whether own chunks go through HDF5's shuffle filter, if a number has several bytes.
        within: the range of its values; readers refuse others. None where all may be.
        more: HDF5 attributes that only this column has.
    """

    name: str
    shape: tuple[int, ...]
    dtype: str
    unit: str = "1"
    frame: str = "-"
    meaning: str = ""
    axes: tuple[str, ...] | None = None
    own_chunk: bool = False
    shuffle: bool = True
    within: tuple[float, float] | None = None
    more: Mapping[str, Any] = field(default_factory=dict)

    @property
    def attributes(self) -> dict[str, Any]:
        """All HDF5 attributes; `shape` names the axes, or else tells their sizes."""
        row = self.shape if self.axes is None else self.axes
        shape = f"({', '.join(('row', *map(str, row)))})"
        usual = {"unit": self.unit, "frame": self.frame, "shape": shape, "meaning": self.meaning}
        return {**usual, **self.more}


@dataclass(frozen=True)
class Format:
    """A kind of HDF5 file of ours.

    Attributes:
        name, version: root attributes `format` and `format_version`; files of the same major
            version can be read.
        kind: what people call such a file, such as "rooms file".
        texts: the other root attributes that are texts, each with a pattern that it matches.
        optional: those of them that a file may lack.
    """

    name: str
    version: str
    kind: str
    texts: Mapping[str, str]
    optional: frozenset[str] = frozenset()


def column_problems(group: h5py.Group, columns: Sequence[Column], count: int) -> list[str]:
    """Return a sentence for each column that is missing or whose values mean something else.

    These are its shape, its type, and the attributes that it alone has.
    """
    problems = []
    for column in columns:
        dataset = group.get(column.name)
        if not isinstance(dataset, h5py.Dataset):
            problems.append(f"dataset {column.name!r} is missing")
            continue
        expected = (count, *column.shape)
        if dataset.shape != expected:
            problems.append(f"{column.name}: shape {dataset.shape}, expected {expected}")
        if column.dtype != "text" and dataset.dtype != np.dtype(column.dtype):
            problems.append(f"{column.name}: type {dataset.dtype}, expected {column.dtype}")
        if column.dtype == "text":
            kind = h5py.check_string_dtype(dataset.dtype)
            if kind is None or (kind.length or 0) > LONGEST_JSON:
                problems.append(f"{column.name}: type {dataset.dtype}, expected strings")
        problems += other_attributes(dataset, column.name, column.more)
    return problems


def attribute_problems(group: h5py.Group, column: Column) -> list[str]:
    """Return a sentence for each attribute of a column that is not as the schema says."""
    attributes = column.attributes
    if column.axes is not None:
        attributes["DIMENSION_LABELS"] = ["row", *column.axes]
    return other_attributes(group[column.name], column.name, attributes)


def other_attributes(dataset: h5py.Dataset, name: str, expected: Mapping[str, Any]) -> list[str]:
    """Return a sentence for each of these attributes that a data set lacks, or has otherwise."""
    problems = []
    for key, value in expected.items():
        # The shape is compared first, so that no attribute of any size is read.
        there = key in dataset.attrs and dataset.attrs.get_id(key).shape == np.shape(value)
        if not (there and np.array_equal(np.asarray(dataset.attrs[key]), np.asarray(value))):
            problems.append(f"{name}: attribute {key!r} is not {value!s:.60}")
    return problems


def name_axes(group: h5py.Group, dataset: h5py.Dataset, axes: Sequence[str]) -> None:
    """Name each axis of a dataset after a scale of `group`: a dataset that counts from 0.

    xarray and netCDF read such names. Scales are made when they are first named. Raises ValueError
    where one name stands for axes of two lengths.
    """
    for axis, name, length in zip(dataset.dims, axes, dataset.shape, strict=True):
        if name not in group:
            _make_scale(group, name, length)
        if group[name].shape != (length,):
            raise ValueError(f"{dataset.name}: axis {name!r} of {length}, not {group[name].shape}")
        axis.label = name
        axis.attach_scale(group[name])


def _make_scale(group: h5py.Group, name: str, length: int) -> None:
    values = np.arange(length, dtype=np.int32)
    scale = group.create_dataset(name, data=values)
    scale.make_scale(name)
    scale.attrs[SHA256] = dataset_digest(values)
