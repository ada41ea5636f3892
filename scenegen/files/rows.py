"""Rows of an open file, whole or in shards: read by column, checked, and fed to training loops.

`RowFile` is what the readers of rooms and of questions are made of.
"""

import operator
import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, Self

import h5py
import numpy as np
from numpy.typing import NDArray

from scenegen.common.errors import FileFormatError
from scenegen.common.names import check_choice
from scenegen.files.attributes import read_digest
from scenegen.files.content import (
    CONTENT_DIGEST,
    SHA256,
    content_digest,
    dataset_digest,
    datasets,
    joint_digest,
)
from scenegen.files.input_file import StoredArray, checking, reading
from scenegen.files.schema import Column, attribute_problems, column_problems
from scenegen.files.sets.shards import JoinedArray, OpenFile

Array = NDArray[Any]


class RowFile:
    """Columns of an open file with a row for each item. Use it as a context manager, or close it.

    Attributes:
        path: of the file.
        opened: the open file; readers that share it are closed together.
        attributes: texts at the root.
        stored_truth_digest: what the file says of the columns that scores depend on; None where it
            has no answers, or was released.
    """

    SCORED: tuple[str, ...] = ()  # columns that scores depend on
    part = ""  # which of the tables of a file

    def __init__(self, opened: OpenFile) -> None:
        """Read the root and take the columns; close the file where it is not what it should be."""
        self.path, self.opened = opened.path, opened
        self.attributes: dict[str, str] = {}
        self.stored_truth_digest: str | None = None
        self._count = 0
        self._stored: dict[str, StoredArray | JoinedArray] = {}
        self._schema: dict[str, tuple[h5py.Group, Column]] = {}
        with checking(opened.file):
            self._open_columns()

    def _open_columns(self) -> None:
        """Read the root, count the rows, and take all columns. Raises FileFormatError."""
        raise NotImplementedError

    def _count_rows(self, name: str) -> None:
        """Take the number of rows from a data set. Raises FileFormatError where it has none."""
        stored = self.opened.array(name)
        if not stored.shape:
            raise FileFormatError(f"{self.path}: {name}", "a value without rows", "rows")
        self._count = stored.shape[0]

    def _take(self, home: str, columns: Sequence[Column]) -> None:
        """Take columns of a group. Raises FileFormatError unless all are as their schema says."""
        group = self.opened.file[home or "/"]
        problems = ["expected a group"]
        if isinstance(group, h5py.Group):
            problems = column_problems(group, columns, self._count)
        if problems:
            place = f"{self.path}: {home}" if home else str(self.path)
            raise FileFormatError(f"{place}: {and_more(problems)}")
        for column in columns:
            self._stored[column.name] = self.opened.array(f"{home}/{column.name}".lstrip("/"))
            self._schema[column.name] = group, column

    def __len__(self) -> int:
        return self._count

    @property
    def fields(self) -> tuple[str, ...]:
        """The names that `read` takes."""
        return tuple(self._stored)

    def check_field(self, name: str) -> None:
        """Raise SpecError unless `read` takes this name."""
        check_choice("field", name, self._stored, expected=f"one of {', '.join(self.fields)}")

    def read(self, name: str, rows: int | slice) -> Any:
        """Read rows of one column, as stored; all values are within the column's range.

        Raises:
            IndexError: a row beyond the file.
            FileFormatError: the rows are damaged, or a value is out of its range.
            SpecError: there is no such column.
        """
        self.check_field(name)
        with reading(self.place(name, rows)):
            values = self._stored[name][rows]
        if name in self._schema and self._schema[name][1].within:
            self._check_values(name, rows, values)
        return values

    def _check_values(self, name: str, rows: int | slice, values: Array) -> None:
        """Raise FileFormatError where one of these rows leaves the range of its column."""
        low, high = self._schema[name][1].within or (0, 0)
        good = (values >= low) & (values <= high)  # NaN is not
        if np.all(good):
            return
        if isinstance(rows, slice):
            first = int(np.argmin(good.reshape(len(values), -1).all(axis=1)))
            rows, values = range(len(self))[rows][first], values[first]
        raise FileFormatError(self.place(name, rows), values.tolist(), f"{low} to {high}")

    def place(self, name: str, rows: int | slice) -> str:
        """Return file, column and rows as text, for an error's `where`."""
        where = f"row {rows}"
        if isinstance(rows, slice):
            first, end, _ = rows.indices(len(self))
            where = f"rows {first} to {end - 1}"
        return f"{self.path}: {name}, {where}"

    @property
    def parts(self) -> list[tuple[Path, int]]:
        """Path and number of rows of each file that holds values: this one, or its shards."""
        shards = [shard for shard in self.opened.shards if shard.part == self.part]
        return [(self.opened.folder / shard.file, shard.rows) for shard in shards] or [
            (self.path, len(self))
        ]

    def unit(self, name: str) -> str:
        """Return the unit of a column; "-" where the file was released without one."""
        return self._schema[name][1].unit if name in self._schema else "-"

    def stored_digests(self) -> dict[str, str]:
        """Return the digest that each column got when it was written; none of released files."""
        digests = {}
        for name, stored in self._stored.items():
            with reading(f"{self.path}: {name}"):
                digest = read_digest(stored.dataset, SHA256, f"{self.path}: {name}")
            if digest is not None:
                digests[name] = digest
        return digests

    def stored_at(self, name: str) -> tuple[Path, str]:
        """Return the file that holds one column, and the name of its data set there."""
        dataset = self._stored[name].dataset
        return Path(dataset.file.filename), dataset.name.lstrip("/")

    def stored_bytes(self) -> dict[str, tuple[int, int]]:
        """Return the bytes on disk and in memory of each column, by name.

        HDF5 does not tell the size of the heaps that hold texts of any length, as other writers
        have them. The last column of these is said to take what all others leave of the file.
        """
        sizes, texts = {}, ""
        with reading(self.path):
            for name, stored in self._stored.items():
                disk = sum(piece.id.get_storage_size() for piece in stored.pieces())
                is_text = h5py.check_vlen_dtype(stored.dtype) is not None
                sizes[name] = (disk, disk if is_text else stored.dataset.nbytes)
                texts = name if is_text else texts
        if texts:
            total = sum(path.stat().st_size for path, _ in self.parts)
            left = total - sum(disk for name, (disk, _) in sizes.items() if name != texts)
            sizes[texts] = left, left
        return sizes

    def compression(self) -> str:
        """Return how the images are compressed: "gzip", "lzf" or "none"."""
        with reading(self.path):
            for stored in self._stored.values():
                piece = next(stored.pieces())  # all shards are alike
                if piece.compression:
                    return str(piece.compression)
        return "none"

    def problems(self, whole: bool = True) -> list[str]:
        """Return what is wrong with attributes of the columns, and with the digest of the truth.

        A file that is not `whole` lacks its truth.
        """
        with reading(self.path):
            problems = [
                problem
                for group, column in self._schema.values()
                for problem in attribute_problems(group, column)
            ]
            if whole and self.stored_truth_digest is not None:
                scored = [name for name in self.SCORED if name in self._stored]
                digests = {name: str(self._stored[name].attrs.get(SHA256)) for name in scored}
                if joint_digest(digests) != self.stored_truth_digest:
                    problems.append(
                        f"the hashes of {', '.join(scored)} do not match the truth hash"
                    )
        return problems

    def reopener(self) -> Callable[[], "RowFile"]:
        """Return a function, which can be pickled, that opens the same rows again."""
        raise NotImplementedError

    def close(self) -> None:
        """Close the file; idempotent."""
        self.opened.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def chosen_rows(index: Any, count: int) -> int | list[int]:
    """Return a row, or a list of rows for a slice, a list or an array, as numpy indexes an axis.

    Raises IndexError for a row beyond the file, and TypeError for what is no index.
    """
    every = np.arange(count)
    if isinstance(index, slice):
        return list(range(count)[index])
    if not isinstance(index, (list, tuple, np.ndarray)):
        if isinstance(index, bool | np.bool_):
            raise TypeError("a row is a whole number, a slice or a list of them, not a bool")
        return int(every[operator.index(index)])
    rows = every[np.asarray(index if len(index) else np.empty(0, int))]
    if rows.ndim != 1:
        raise IndexError(f"rows are chosen by a list of numbers, not of the shape {rows.shape}")
    return [int(row) for row in rows]


class RowBlock:
    """Some rows in a row of a file, each column read at once.

    Attributes:
        values: by name; without the columns of which some of these rows are damaged.
    """

    def __init__(self, file: RowFile, rows: range) -> None:
        """Read the rows."""
        self.rows, self._file = rows, file
        self.values: dict[str, Sequence[Any]] = {}
        for name in file.fields:
            with suppress(FileFormatError):
                self.values[name] = file.read(name, slice(rows.start, rows.stop))

    def read(self, name: str, row: int) -> Any:
        """Return one row, perhaps of another block, as `RowFile.read`."""
        if name in self.values and row in self.rows:
            return self.values[name][row - self.rows.start]
        return self._file.read(name, row)


class RowDataset:
    """A map-style dataset (`__len__`, `__getitem__` -> dict of arrays) for any training loop.

    `torch.utils.data.DataLoader` takes it as it is, with any number of workers: it is pickled
    without the open file, and every process opens the file for itself when it first reads.
    """

    def __init__(self, rows: RowFile, fields: Sequence[str]) -> None:
        """Read from an open file; it is opened again where it was closed, and in other processes.

        Raises SpecError for an unknown field.
        """
        for name in fields:
            rows.check_field(name)
        self.fields, self._length = tuple(fields), len(rows)
        self._reopen, self._content = rows.reopener(), _content_of(rows)
        self._open: tuple[int, RowFile] | None = os.getpid(), rows

    def __len__(self) -> int:
        return self._length

    def __getitem__(self, index: Any) -> dict[str, Any]:
        """Return the fields of a row, by name; image values are as stored.

        A slice or a list of rows gives each field with an axis of rows before its own.

        Raises as `chosen_rows`, and FileFormatError where rows are damaged, or the file was
        replaced by another since this data set was made.
        """
        rows, file = chosen_rows(index, self._length), self._file()
        if isinstance(rows, int):
            return {name: file.read(name, rows) for name in self.fields}
        return {name: _stacked(file, name, rows) for name in self.fields}

    def _file(self) -> RowFile:
        """Return the file, open in this process."""
        process = os.getpid()
        if self._open is None or self._open[0] != process or not self._open[1].opened.is_open:
            file = self._reopen()
            if _content_of(file) != self._content:
                file.close()
                message = f"{file.path}: the file was replaced since this data set was made"
                raise FileFormatError(message, hint="make the data set again")
            self._open = process, file
        return self._open[1]

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_open": None}


def _content_of(file: RowFile) -> Any:
    """Return what tells a file from another: its digest, or size and time where it has none."""
    about = os.stat(file.path)
    return file.opened.file.attrs.get(CONTENT_DIGEST) or (about.st_size, about.st_mtime_ns)


def _stacked(file: RowFile, name: str, rows: list[int]) -> Array:
    values = [file.read(name, row) for row in rows]
    return np.stack(values) if values else np.asarray(file.read(name, slice(0, 0)))


def content_problems(opened: OpenFile, digests: Mapping[str, str], whole: bool = True) -> list[str]:
    """Return a sentence for each data set that is not as it was sealed, and one for attributes.

    `digests` are the `content.column_digest`s of data sets that the caller has read already. The
    attributes of a file that is not `whole` are those of the whole one. Raises FileFormatError
    where the attributes cannot be read.
    """
    problems = []
    with reading(opened.path):
        for name, dataset in datasets(opened.file):
            sealed = dataset.attrs.get(SHA256)
            try:
                with reading(name):
                    digest = digests.get(name) or dataset_digest(opened.array(name))
            except FileFormatError as error:
                problems.append(str(error))
                continue
            if sealed is None:
                problems.append(f"{name}: attribute {SHA256!r} is missing")
            elif not (isinstance(sealed, str) and sealed == digest):
                problems.append(f"{name}: values are not those of its attribute {SHA256!r}")
        sealed = opened.file.attrs.get(CONTENT_DIGEST)
        if whole and not (isinstance(sealed, str) and sealed == content_digest(opened.file)):
            what = "the attributes, or the names, types and shapes of the datasets,"
            problems.append(f"{what} are not those of the attribute {CONTENT_DIGEST!r}")
    return problems


def and_more(problems: Sequence[str]) -> str:
    """Return the first problem and how many follow it."""
    more = f" (and {len(problems) - 1} more problems)" if len(problems) > 1 else ""
    return problems[0] + more
