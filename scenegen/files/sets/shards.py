"""A set of shards: HDF5 files that lie beside each other, and one file that shows them as one.

The file of the set has a virtual data set for each data set of its shards, so that plain h5py reads
all of them as one file. They are named without folders: the files may be moved together. HDF5 reads
a shard that is missing as fill values, and follows a virtual data set to any file; so our own
readers open the shards themselves, and only those that the data set `shards` of the set names.

Each shard has a data set `row_sha256` with the digest of every row of each data set, so that the
digests of the set follow from those of its shards, and a damaged row can be named.
"""

import glob
import os
import re
from collections import OrderedDict
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from itertools import accumulate
from pathlib import Path
from typing import Any, Self

import h5py
import numpy as np
from numpy.typing import NDArray

from scenegen.common.errors import FileFormatError
from scenegen.common.records import check, from_json
from scenegen.files.content import CONTENT_DIGEST
from scenegen.files.input_file import (
    StoredArray,
    checking,
    describing,
    faults,
    is_virtual,
    open_file,
    open_unchecked,
    storage_of,
    virtual_sources,
)
from scenegen.files.places import as_place, is_remote
from scenegen.files.schema import DIGEST

Array = NDArray[Any]
SHARDS = "shards"  # in the file of a set: a line of JSON for each shard
ROW_DIGESTS = "row_sha256"  # in a shard: (rows, data sets, 32) bytes; its attribute has the names
MOST_SHARDS = 10_000
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

    def __post_init__(self) -> None:
        check(self.rows > 0, "rows", self.rows, "at least 1")
        is_digest = re.fullmatch(DIGEST, self.content_digest) is not None
        check(is_digest, "content_digest", f"{self.content_digest!r:.40}", "64 hexadecimal digits")
        is_part = PART.fullmatch(self.part) is not None
        check(is_part, "part", f"{self.part!r:.40}", "the name of a group")


def shard_name(path: str | Path, number: int, count: int) -> str:
    """Return the name of a shard, such as `rooms-00003-of-00128.h5` of `rooms.h5`."""
    path = as_place(path)
    return f"{path.stem}-{number:05d}-of-{count:05d}{path.suffix}"


def name_of_set(name: str) -> str | None:
    """Return the name of the set that a shard of this name belongs to; None if it is no shard's."""
    match = SHARD_NAME.fullmatch(name)
    return None if match is None else "".join(match.groups())


def cut(count: int, size: int) -> list[range]:
    """Return the items of each shard: `size` of them, and the rest in the last."""
    return [range(first, min(first + size, count)) for first in range(0, count, size)]


@contextmanager
def opened(place: Path) -> Iterator[h5py.File]:
    """Open an HDF5 file that a run of ours has just made, also behind a URL."""
    with ExitStack() as stack:
        source = stack.enter_context(place.open("rb")) if is_remote(place) else place
        yield stack.enter_context(h5py.File(source, "r"))


def _place_of_set(path: Path) -> Path:
    """Return the path beside which the shards of a set lie: its own, or what a link leads to."""
    if not path.is_symlink() or any(path.parent.glob(f"{glob.escape(path.stem)}-00000-of-*")):
        return path
    return Path(os.path.realpath(path))  # Path.resolve raises RuntimeError at a link to itself


class OpenFile:
    """An open HDF5 file of which every object is safe to open, and its shards if it is a set.

    The shards are opened when they are first read; a few are kept open. Use it as a context
    manager, or close it.

    Attributes:
        path: of the file.
        file: what h5py opened. Its virtual data sets are read by `array` only.
        shards: of a set; empty for a whole file.
        folder: where the shards lie: beside the file, or beside the file that a link leads to.
    """

    def __init__(self, path: str | Path, kind: str) -> None:
        """Open a file; `kind` is what it should be.

        Raises OSError for what is no regular file, and FileFormatError for one that is not HDF5, or
        cut off, or of which something cannot be read within bounds, or leads out of the file other
        than to the shards beside it, or of which a shard is missing.
        """
        self.path, self._kind = Path(path), kind
        place = _place_of_set(self.path)
        self.folder = place.parent
        self.file = open_unchecked(path, kind)
        self.shards: list[Shard] = []
        self._open: OrderedDict[int, h5py.File] = OrderedDict()
        self._arrays: dict[tuple[int, str], StoredArray] = {}
        with checking(self.file):
            unsafe = list(faults(self.file))
            # Reading the list would follow it if it were virtual too, so that is no set.
            virtual = all(fault.virtual and fault.name != SHARDS for fault in unsafe)
            is_set = virtual and isinstance(self.file.get(SHARDS), h5py.Dataset)
            if unsafe and not is_set:
                fault = min(unsafe, key=lambda fault: fault.virtual)
                raise FileFormatError(f"{path}: {fault.name}", fault.found, fault.expected)
            if unsafe:
                self.shards = _read_list(self.file[SHARDS], place)
                for fault in unsafe:
                    self._check_sources(self.file[fault.name])
                self._check_shards()

    def _check_sources(self, dataset: h5py.Dataset) -> None:
        """Raise FileFormatError unless a virtual data set shows the rows of its shards in order."""
        sources, name = virtual_sources(dataset), dataset.name.lstrip("/")
        shards = [self.shards[i] for i in self.numbers(dataset)]
        starts = accumulate((shard.rows for shard in shards), initial=0)
        expected = [(s.file, name, start, s.rows) for s, start in zip(shards, starts, strict=False)]
        if sources != expected:
            strange = [f"rows from {source}" for source in sources if source not in expected]
            where, found = f"{self.path}: {name}", [*strange, "rows in another order"][0]
            raise FileFormatError(where, found, "all rows of its shards, in their order")

    def _check_shards(self) -> None:
        missing = [s.file for s in self.shards if not (self.folder / s.file).is_file()]
        if missing:
            more = f" and {len(missing) - 1} more" if len(missing) > 1 else ""
            hint = "copy all files of the set together, or run the command that made it again"
            raise FileFormatError(self.path, f"no {missing[0]}{more} beside it", "all shards", hint)

    def array(self, name: str) -> "StoredArray | JoinedArray":
        """Return a data set, to be read. Raises FileFormatError where there is none."""
        dataset = self.file.get(name)
        if not isinstance(dataset, h5py.Dataset):
            raise FileFormatError(f"{self.path}: {name}", "no dataset", "a dataset of this name")
        return JoinedArray(self, dataset) if is_virtual(dataset) else StoredArray(dataset)

    def numbers(self, dataset: h5py.Dataset) -> list[int]:
        """Return which shards hold the rows of a virtual data set."""
        with storage_of(dataset.id) as storage:
            first = storage.get_virtual_filename(0) if storage.get_virtual_count() else None
        part = next((shard.part for shard in self.shards if shard.file == first), None)
        return [i for i, shard in enumerate(self.shards) if shard.part == part]

    def shard(self, number: int) -> h5py.File:
        """Return an open shard. Raises FileFormatError where it is not the one that was made."""
        if number not in self._open:
            shard = self.shards[number]
            place = self.folder / shard.file
            file = open_file(place, self._kind)
            digest = file.attrs.get(CONTENT_DIGEST)
            if digest != shard.content_digest:
                file.close()
                expected = f"{shard.content_digest:.16}..., as {self.path.name} tells"
                hint = "it is of another run, or was changed"
                raise FileFormatError(place, f"content {digest!r:.20}", expected, hint)
            self._open[number] = file
            while len(self._open) > MOST_OPEN:
                oldest, other = self._open.popitem(last=False)
                other.close()
                self._arrays = {k: v for k, v in self._arrays.items() if k[0] != oldest}
        self._open.move_to_end(number)
        return self._open[number]

    def shard_array(self, number: int, name: str) -> StoredArray:
        """Return a data set of a shard, which keeps what it knows of its chunks."""
        file = self.shard(number)
        if (number, name) not in self._arrays:
            stored, rows = StoredArray(file[name]), self.shards[number].rows
            if len(stored) != rows:
                raise FileFormatError(f"{file.filename}: {name}", f"{len(stored)} rows", f"{rows}")
            self._arrays[number, name] = stored
        return self._arrays[number, name]

    @property
    def is_open(self) -> bool:
        """Whether the file has not been closed."""
        return bool(self.file)

    def close(self) -> None:
        """Close the file and its shards; idempotent."""
        self.file.close()
        self._arrays.clear()
        while self._open:
            self._open.popitem()[1].close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _read_list(listed: h5py.Dataset, path: Path) -> list[Shard]:
    """Return the shards that the file of a set names, each beside it."""
    where = f"{path}: {SHARDS}"
    text = h5py.check_string_dtype(listed.dtype) is not None
    if not text or listed.ndim != 1 or not 1 <= len(listed) <= MOST_SHARDS:
        raise FileFormatError(where, f"{listed.dtype} {listed.shape}", "a line for each shard")
    shards = []
    for line in StoredArray(listed)[()]:
        with describing(where):
            shard = from_json(Shard, line, "shard", LONGEST_LINE)
        if name_of_set(shard.file) != path.name:
            expected = f"such as {shard_name(path, 0, len(listed))}"
            raise FileFormatError(where, shard.file, expected, "the set was renamed or damaged")
        shards.append(shard)
    return shards


class JoinedArray:
    """A data set of a set, read from the shards as `StoredArray` reads one of a file."""

    def __init__(self, opened: OpenFile, dataset: h5py.Dataset) -> None:
        """Raise FileFormatError where the shards of its part have another number of rows."""
        self.dataset, self._opened = dataset, opened
        self._numbers = opened.numbers(dataset)
        self._starts = [0, *accumulate(opened.shards[i].rows for i in self._numbers)]
        if self._starts[-1] != dataset.shape[0]:
            where = f"{opened.path}: {dataset.name}"
            raise FileFormatError(where, f"{dataset.shape[0]} rows", f"{self._starts[-1]}")
        self.shape: tuple[int, ...] = dataset.shape
        self.dtype, self.attrs = dataset.dtype, dataset.attrs

    def __len__(self) -> int:
        return int(self.shape[0])

    def pieces(self) -> Iterator[h5py.Dataset]:
        """Yield the data sets of the shards that hold the values."""
        return (self._opened.shard(number)[self.dataset.name] for number in self._numbers)

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
            stored = self._opened.shard_array(self._numbers[number], self.dataset.name)
            # The texts of a shard may be shorter than those of another one.
            as_here = stored.dtype == self.dtype or (
                stored.dtype.kind == self.dtype.kind == "S"
                and stored.dtype.itemsize <= self.dtype.itemsize
            )
            if stored.shape[1:] != self.shape[1:] or not as_here:
                found = f"{stored.dtype} {stored.shape}"
                raise ValueError(f"{found} in a shard, not {self.dtype} {self.shape}")
            low, high = int(inside.min()), int(inside.max()) + 1
            if high - low == len(inside):
                values[places] = stored[low:high]
            else:
                values[places] = [stored[i] for i in inside.tolist()]
        return values
