"""What all our HDF5 files have in common: how they get their names, what they must hold, digests.

A file gets its name when it is complete.
"""

import errno
import importlib.metadata
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, TypeVar

import h5py
import numpy as np
from numpy.typing import NDArray

from scenegen.common.errors import FileFormatError, SpecError
from scenegen.files.content import (
    CONTENT_DIGEST,
    SHA256,
    content_digest,
    dataset_digest,
    datasets,
)
from scenegen.files.input_file import StoredArray, reading
from scenegen.files.new_file import written_beside
from scenegen.files.shards import Opened
from scenegen.files.table import Column

Array = NDArray[Any]
Spec = TypeVar("Spec")
CLOSING_SLACK = 8192  # bytes that HDF5 may need to close a file beyond what it says it needs


@contextmanager
def new_file(path: str | Path, overwrite: bool = False) -> Iterator[h5py.File]:
    """Open a new HDF5 file, which gets its name when the block ends well, as `written_beside`."""
    with written_beside(path, overwrite) as temporary:
        file = h5py.File(temporary, "w", rdcc_nbytes=0)  # without a cache of unwritten chunks
        try:
            yield file
            _check_room_to_close(file, temporary)
            file.close()
        except BaseException:
            # The file is lost. Where the disk is full, emptying the file first makes room for HDF5
            # to close it; a file that it cannot close would crash the process at exit.
            os.truncate(temporary, 0)
            with suppress(Exception):
                file.close()
            raise


def column_problems(group: h5py.Group, columns: Sequence[Column], count: int) -> list[str]:
    """Return a sentence for each column that is missing or has the wrong shape or type."""
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
        if column.dtype == "text" and h5py.check_string_dtype(dataset.dtype) is None:
            problems.append(f"{column.name}: type {dataset.dtype}, expected strings")
    return problems


def digest_problems(
    file: h5py.File, known: Mapping[str, str], stored: Opened = StoredArray
) -> list[str]:
    """Return a sentence for each dataset that is not as it was sealed, and one for the attributes.

    `known` are the `content.column_digest`s of datasets that the caller has read already; `stored`
    opens the others. Raises FileFormatError where the attributes cannot be read.
    """
    problems = []
    with reading(file.filename):
        for name, dataset in datasets(file):
            told = dataset.attrs.get(SHA256)
            try:
                with reading(name):
                    found = known.get(name) or dataset_digest(stored(dataset))
            except FileFormatError as error:
                problems.append(str(error))
                continue
            if told is None:
                problems.append(f"{name}: attribute {SHA256!r} is missing")
            elif not (isinstance(told, str) and told == found):
                problems.append(f"{name}: values are not those of its attribute {SHA256!r}")
        told = file.attrs.get(CONTENT_DIGEST)
        if not (isinstance(told, str) and told == content_digest(file)):
            what = "the attributes, or the names, types and shapes of the datasets,"
            problems.append(f"{what} are not those of the attribute {CONTENT_DIGEST!r}")
    return problems


def read_spec(
    path: Path, texts: Mapping[str, str], version: str, from_json: Callable[[str], Spec]
) -> Spec:
    """Return the request that a file answers, from the root's texts, which all our files have.

    Raises FileFormatError for a major version other than `version`'s, a missing attribute and a
    request that `from_json` refuses.
    """
    found, major = str(texts.get("format_version")), version.split(".", maxsplit=1)[0]
    if found.split(".", maxsplit=1)[0] != major:
        raise FileFormatError(
            f"{path}: format version {found}",
            expected=f"{major}.x",
            hint=f"read it with the release that wrote it ({texts.get('writer')})",
        )
    for name in ("spec", "writer"):
        if name not in texts:
            raise FileFormatError(f"{path}: attribute {name!r}", "none", "a text")
    with describing(f"{path}: attribute 'spec'"):
        return from_json(texts["spec"])


@contextmanager
def describing(place: str) -> Iterator[None]:
    """Turn the SpecError of a stored description into a FileFormatError of its place."""
    try:
        yield
    except SpecError as error:
        where = f"{place}: {error.where}"
        raise FileFormatError(where, error.found, error.expected, error.hint) from error


def and_more(problems: Sequence[str]) -> str:
    """Return the first problem and how many follow it."""
    more = f" (and {len(problems) - 1} more problems)" if len(problems) > 1 else ""
    return problems[0] + more


def _check_room_to_close(file: h5py.File, path: Path) -> None:
    """Raise OSError where the disk has no room for what HDF5 still has to write."""
    if not hasattr(os, "statvfs"):
        return
    disk, written = os.statvfs(path), os.stat(path).st_blocks * 512
    if file.id.get_filesize() - written + CLOSING_SLACK > disk.f_bavail * disk.f_frsize:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))


def writer_name() -> str:
    """Return name and version of this program, as files record them."""
    return f"pix2shape-bench {importlib.metadata.version('pix2shape-bench')}"


def program_version() -> dict[str, str]:
    """Return name and version of this program, for workers of a cluster to be compared by."""
    return {"writer": writer_name()}


class RowDataset:
    """A map-style dataset (`__len__`, `__getitem__` -> dict of arrays) for any training loop.

    `torch.utils.data.DataLoader` takes it as it is, with any number of workers: it is pickled
    without the open file, and every process opens the file for itself when it first reads.
    """

    def __init__(self, opener: Callable[[], Any], length: int, fields: Sequence[str]) -> None:
        """Keep how to open the file; `opener` can be pickled, and gives a reader with `read`."""
        self.fields, self._opener, self._length = tuple(fields), opener, length
        self._open: tuple[int, Any] | None = None

    def __len__(self) -> int:
        return self._length

    def __getitem__(self, index: int) -> dict[str, Any]:
        """Return the fields of one row, by name; image values are as stored."""
        row = range(self._length)[index]
        if self._open is None or self._open[0] != os.getpid():
            self._open = (os.getpid(), self._opener())
        file = self._open[1]
        return {name: file.read(name, row) for name in self.fields}

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_open": None}
