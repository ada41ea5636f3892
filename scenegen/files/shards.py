"""A set of shards: HDF5 files that lie beside each other, and one file that shows them as one.

The file of the set has a virtual data set for each data set of its shards, so that plain h5py reads
all of them as one file. They are named without folders: the files may be moved together. HDF5 reads
a shard that is missing as fill values, and follows a virtual data set to any file; so our own
readers open the shards themselves, and only those that the data set `shards` of the set names.

Each shard has a data set `row_sha256` with the digest of every row of each data set, so that the
digests of the set follow from those of its shards, and a damaged row can be named.
"""

import json
import re
from collections import OrderedDict
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, closing, contextmanager, nullcontext
from dataclasses import dataclass
from itertools import accumulate
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from scenegen.common.errors import FileFormatError
from scenegen.files.content import CONTENT_DIGEST, SHA256, dataset_digest
from scenegen.files.input_file import (
    StoredArray,
    checking,
    faults,
    open_file,
    open_unchecked,
    virtual_sources,
)
from scenegen.files.places import as_place, is_remote
from scenegen.files.trial import Trials, was_tried

Array = NDArray[Any]
SHARDS = "shards"  # in the file of a set: a line of JSON for each shard
ROW_DIGESTS = "row_sha256"  # in a shard: (rows, data sets, 32) bytes; its attribute has the names
MOST_SHARDS = 10_000  # whose manifest is still read
LONGEST_LINE = 1000  # characters
PART = re.compile(r"\w{0,40}")
SHARD_NAME = re.compile(r"(.+)-\d{5}-of-\d{5}(\.[^.]*|)", re.DOTALL)
MOST_OPEN = 32  # shards that a reader keeps open


@dataclass(frozen=True)
class Shard:
    """One shard of a set, as the set tells of it.

    Attributes:
        file: its name, without a folder.
        rows: their number.
        content_digest: the attribute of that name.
        part: the group whose rows these are, where a set has several tables; else empty.
    """

    file: str
    rows: int
    content_digest: str
    part: str = ""


def shard_name(path: str | Path, number: int, count: int) -> str:
    """Return the name of a shard, such as `rooms-00003-of-00128.h5` of `rooms.h5`."""
    path = as_place(path)
    return f"{path.stem}-{number:05d}-of-{count:05d}{path.suffix}"


def set_name(name: str) -> str | None:
    """Return the name of the set that a shard of this name belongs to; None if it is no shard's."""
    found = SHARD_NAME.fullmatch(name)
    return None if found is None else "".join(found.groups())


def cut(count: int, size: int) -> list[range]:
    """Return the items of each shard: `size` of them, and the rest in the last."""
    return [range(first, min(first + size, count)) for first in range(0, count, size)]


def write_row_digests(group: h5py.Group, digests: Mapping[str, bytes]) -> None:
    """Write the digests of all rows, 32 bytes each in their order, by name of the data set.

    Names are as seen from `group`, the root of a shard.
    """
    names = sorted(digests)
    rows = [np.frombuffer(digests[name], np.uint8).reshape(-1, 32) for name in names]
    values = np.stack(rows, axis=1)
    dataset = group.create_dataset(ROW_DIGESTS, data=values)
    dataset.attrs["names"] = names
    dataset.attrs["meaning"] = "SHA-256 of each row of each data set, as `sha256` is made of them"
    dataset.attrs[SHA256] = dataset_digest(values)


@contextmanager
def opened(place: Path) -> Iterator[h5py.File]:
    """Open an HDF5 file that a run of ours has just made, also behind a URL."""
    with ExitStack() as stack:
        source = stack.enter_context(place.open("rb")) if is_remote(place) else place
        yield stack.enter_context(h5py.File(source, "r"))


def open_with_shards(path: Path, kind: str) -> tuple[h5py.File, "ShardFiles | None"]:
    """Open a file as `open_file`, or the file of a set and its shards.

    Raises as `open_file`, and FileFormatError where a shard is missing, or a virtual data set leads
    to anything but the data set of its name in the shards.
    """
    file = open_unchecked(path, kind)
    with checking(file):
        found = list(faults(file))
        virtual = [fault for fault in found if fault.virtual]
        others = [fault for fault in found if not fault.virtual]
        is_set = virtual and not others and isinstance(file.get(SHARDS), h5py.Dataset)
        for fault in others if is_set else found:
            raise FileFormatError(f"{path}: {fault.name}", fault.found, fault.expected)
        if not is_set:
            return file, None
        shards = _read_list(file[SHARDS], path)
        part_of = {shard.file: shard.part for shard in shards}
        for fault in virtual:
            sources = virtual_sources(file[fault.name])
            part = part_of.get(sources[0][0]) if sources else None
            own = [shard for shard in shards if shard.part == part]
            starts = accumulate((shard.rows for shard in own), initial=0)
            expected = [
                (shard.file, fault.name, start, shard.rows)
                for shard, start in zip(own, starts, strict=False)
            ]
            if sources != expected:
                strange = [f"rows from {one}" for one in sources if one not in expected]
                where, found_here = f"{path}: {fault.name}", [*strange, "rows in another order"][0]
                raise FileFormatError(where, found_here, "all rows of its shards, in their order")
        return file, ShardFiles(path, shards, kind)


@contextmanager
def opened_with_shards(path: Path, kind: str) -> Iterator[tuple[h5py.File, "ShardFiles | None"]]:
    """Open a file as `open_with_shards`, and close all that was opened."""
    file, shards = open_with_shards(path, kind)
    with closing(shards) if shards else nullcontext(), file:
        yield file, shards


def _read_list(listed: h5py.Dataset, path: Path) -> list[Shard]:
    """Return the shards that the file of a set names, each beside it."""
    where = f"{path}: {SHARDS}"
    text = h5py.check_string_dtype(listed.dtype) is not None
    if not text or listed.ndim != 1 or not 1 <= len(listed) <= MOST_SHARDS:
        raise FileFormatError(where, f"{listed.dtype} {listed.shape}", "a line for each shard")
    found = []
    for line in StoredArray(listed)[()]:
        try:
            shard = Shard(**json.loads(line[:LONGEST_LINE]))
            good = shard.rows > 0 and type(shard.rows) is int
            good &= re.fullmatch("[0-9a-f]{64}", shard.content_digest) is not None
            good &= set_name(shard.file) == path.name and PART.fullmatch(shard.part) is not None
        except (TypeError, ValueError, RecursionError):
            good = False
        if not good:
            expected = f"file, rows and content_digest, as of {shard_name(path, 0, len(listed))}"
            raise FileFormatError(
                where, f"{line!r:.80}", expected, "the set was renamed or damaged"
            )
        found.append(shard)
    return found


class ShardFiles:
    """The shards of a set, opened when they are first read; a few are kept open."""

    def __init__(self, path: Path, shards: Sequence[Shard], kind: str) -> None:
        """Keep where they are. Raises FileFormatError where one of them is missing."""
        self.path, self.shards, self._kind = path, shards, kind
        self._trials = Trials() if was_tried(path) else None  # a shard is tried where its set was
        self._open: OrderedDict[int, h5py.File] = OrderedDict()
        self._arrays: dict[tuple[int, str], StoredArray] = {}
        missing = [shard.file for shard in shards if not (path.parent / shard.file).is_file()]
        if missing:
            more = f" and {len(missing) - 1} more" if len(missing) > 1 else ""
            hint = "copy all files of the set together, or run the command that made it again"
            raise FileFormatError(path, f"no {missing[0]}{more} beside it", "all shards", hint)

    def file(self, number: int) -> h5py.File:
        """Return an open shard.

        Raises FileFormatError where it is not the one that was made, and as `Trials.try_file`.
        """
        if number not in self._open:
            shard = self.shards[number]
            if self._trials is not None:
                self._trials.try_file(self.path.parent / shard.file)
            file = open_file(self.path.parent / shard.file, self._kind)
            found = file.attrs.get(CONTENT_DIGEST)
            if found != shard.content_digest:
                file.close()
                raise FileFormatError(
                    self.path.parent / shard.file,
                    f"content {found!r:.20}",
                    f"{shard.content_digest:.16}..., as {self.path.name} tells",
                    "it is of another run, or was changed",
                )
            self._open[number] = file
            while len(self._open) > MOST_OPEN:
                oldest, other = self._open.popitem(last=False)
                other.close()
                self._arrays = {k: v for k, v in self._arrays.items() if k[0] != oldest}
        self._open.move_to_end(number)
        return self._open[number]

    def array(self, number: int, name: str) -> StoredArray:
        """Return a data set of a shard, which keeps what it knows of its chunks."""
        file = self.file(number)
        if (number, name) not in self._arrays:
            stored, rows = StoredArray(file[name]), self.shards[number].rows
            if len(stored) != rows:
                where = f"{file.filename}: {name}"
                raise FileFormatError(where, f"{len(stored)} rows", f"{rows}")
            self._arrays[number, name] = stored
        return self._arrays[number, name]

    def numbers(self, dataset: h5py.Dataset) -> list[int]:
        """Return which shards hold the rows of a virtual data set of the set."""
        storage = dataset.id.get_create_plist()
        first = storage.get_virtual_filename(0) if storage.get_virtual_count() else None
        part = next((shard.part for shard in self.shards if shard.file == first), None)
        return [i for i, shard in enumerate(self.shards) if shard.part == part]

    def stored_bytes(self, dataset: h5py.Dataset) -> int:
        """Return the bytes on disk of a virtual data set of the set, in all its shards."""
        numbers = self.numbers(dataset)
        return sum(int(self.file(i)[dataset.name].id.get_storage_size()) for i in numbers)

    def close(self) -> None:
        """Close all that is open."""
        if self._trials is not None:
            self._trials.close()
        self._arrays.clear()
        while self._open:
            self._open.popitem()[1].close()


class JoinedArray:
    """A data set of a set, read from the shards as `StoredArray` reads one of a file."""

    def __init__(self, files: ShardFiles, dataset: h5py.Dataset) -> None:
        """Raise FileFormatError where the shards of its part have another number of rows."""
        self.dataset, self._files = dataset, files
        self._numbers = files.numbers(dataset)
        self._starts = [0, *accumulate(files.shards[i].rows for i in self._numbers)]
        if self._starts[-1] != dataset.shape[0]:
            where = f"{files.path}: {dataset.name}"
            raise FileFormatError(where, f"{dataset.shape[0]} rows", f"{self._starts[-1]}")
        self.shape: tuple[int, ...] = dataset.shape
        self.dtype, self.attrs = dataset.dtype, dataset.attrs

    def __len__(self) -> int:
        return int(self.shape[0])

    def __getitem__(self, rows: int | slice | tuple[()]) -> Any:
        """Return one row, some, or all for (). Raises IndexError, and as HDF5 does on damage."""
        if isinstance(rows, (int, np.integer)):
            row = range(len(self))[rows]
            return self[row : row + 1][0]
        chosen = np.arange(len(self))[slice(None) if isinstance(rows, tuple) else rows]
        values = np.empty((len(chosen), *self.shape[1:]), self.dtype)
        shard = np.searchsorted(self._starts, chosen, side="right") - 1
        for number in np.unique(shard).tolist():
            places = np.flatnonzero(shard == number)
            inside = chosen[places] - self._starts[number]
            stored = self._files.array(self._numbers[number], self.dataset.name)
            if stored.shape[1:] != self.shape[1:] or stored.dtype != self.dtype:
                found = f"{stored.dtype} {stored.shape}"
                raise ValueError(f"{found} in a shard, not {self.dtype} {self.shape}")
            low, high = int(inside.min()), int(inside.max()) + 1
            if high - low == len(inside):
                values[places] = stored[low:high]
            else:
                values[places] = [stored[i] for i in inside.tolist()]
        return values


Opened = Callable[[h5py.Dataset], StoredArray | JoinedArray]


def stored_array(dataset: h5py.Dataset, shards: ShardFiles | None) -> StoredArray | JoinedArray:
    """Return a data set of a file that `open_with_shards` opened, to be read."""
    if shards is not None and dataset.is_virtual:
        return JoinedArray(shards, dataset)
    return StoredArray(dataset)
