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
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from scenegen.common.errors import FileFormatError
from scenegen.common.hdf5.axes import name_axes
from scenegen.common.hdf5.content import CONTENT_DIGEST, SHA256, column_digest, dataset_digest
from scenegen.common.hdf5.input_file import (
    StoredArray,
    checking,
    faults,
    open_file,
    open_unchecked,
    virtual_sources,
)
from scenegen.common.hdf5.trial import Trials, was_tried

Array = NDArray[Any]
SHARDS = "shards"  # in the file of a set: a line of JSON for each shard
ROW_DIGESTS = "row_sha256"  # in a shard: (rows, data sets, 32) bytes; its attribute has the names
MOST_SHARDS = 10_000  # whose manifest is still read
LONGEST_LINE = 1000  # characters
MOST_OPEN = 32  # shards that a reader keeps open


@dataclass(frozen=True)
class Shard:
    """One shard of a set, as the set tells of it.

    Attributes:
        file: its name, without a folder.
        rows: their number.
        content_digest: the attribute of that name.
    """

    file: str
    rows: int
    content_digest: str


def shard_name(path: str | Path, number: int, count: int) -> str:
    """Return the name of a shard, such as `rooms-00003-of-00128.h5` of `rooms.h5`."""
    path = Path(path)
    return f"{path.stem}-{number:05d}-of-{count:05d}{path.suffix}"


def cut(count: int, size: int) -> list[range]:
    """Return the items of each shard: `size` of them, and the rest in the last."""
    return [range(first, min(first + size, count)) for first in range(0, count, size)]


def write_row_digests(group: h5py.Group, digests: Mapping[str, bytes]) -> None:
    """Write the digests of all rows, 32 bytes each in their order, by name of the data set."""
    names = sorted(digests)
    rows = [np.frombuffer(digests[name], np.uint8).reshape(-1, 32) for name in names]
    values = np.stack(rows, axis=1)
    dataset = group.create_dataset(ROW_DIGESTS, data=values)
    dataset.attrs["names"] = names
    dataset.attrs["meaning"] = "SHA-256 of each row of each data set, as `sha256` is made of them"
    dataset.attrs[SHA256] = dataset_digest(values)


def write_virtual(
    file: h5py.File, folder: Path, shards: Sequence[Shard], axes: Mapping[str, Any]
) -> None:
    """Write what a file of a set holds: virtual data sets over the shards, and the list of these.

    Data sets that count an axis are copied from the first shard.

    Args:
        folder: where the shards are now.
        axes: names of the axes of a row, by name of the data set.
    """
    rows = sum(shard.rows for shard in shards)
    with h5py.File(folder / shards[0].file, "r") as first:
        for name, names in axes.items():
            model = first[name]
            layout = h5py.VirtualLayout((rows, *model.shape[1:]), model.dtype)
            layout.dcpl.set_obj_track_times(False)  # the same bytes at any time
            start = 0
            for shard in shards:
                shape = (shard.rows, *model.shape[1:])
                layout[start : start + shard.rows] = h5py.VirtualSource(shard.file, name, shape)
                start += shard.rows
            fill = np.nan if model.dtype.kind == "f" else None
            dataset = file.create_virtual_dataset(name, layout, fillvalue=fill)
            own = ("DIMENSION_LABELS", "DIMENSION_LIST", SHA256)
            dataset.attrs.update({k: v for k, v in model.attrs.items() if k not in own})
            name_axes(file, dataset, ("row", *names))
    for name, digest in _joint_digests(folder, shards).items():
        file[name].attrs[SHA256] = digest
    lines = np.array([json.dumps(vars(shard)) for shard in shards], object)
    listed = file.create_dataset(SHARDS, data=lines, dtype=h5py.string_dtype())
    listed.attrs["meaning"] = "the files beside this one that hold the values, in their order"
    listed.attrs[SHA256] = dataset_digest(lines)


def _joint_digests(folder: Path, shards: Iterable[Shard]) -> dict[str, str]:
    """Return the `column_digest` of each data set over all shards."""
    parts: dict[str, list[bytes]] = {}
    for shard in shards:
        with h5py.File(folder / shard.file, "r") as file:
            digests = file[ROW_DIGESTS]
            values = digests[()]
            for i, name in enumerate(digests.attrs["names"]):
                parts.setdefault(name, []).append(values[:, i].tobytes())
    return {name: column_digest(some) for name, some in parts.items()}


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
        names = {shard.file for shard in shards}
        for fault in virtual:
            own = {(name, fault.name) for name in names}
            strange = virtual_sources(file[fault.name]) - own
            if strange:
                where = f"{path}: {fault.name}"
                raise FileFormatError(where, f"values from {min(strange)}", "the set's own shards")
        return file, ShardFiles(path, shards, kind)


def _read_list(listed: h5py.Dataset, path: Path) -> list[Shard]:
    """Return the shards that the file of a set names, each beside it."""
    where = f"{path}: {SHARDS}"
    text = h5py.check_string_dtype(listed.dtype) is not None
    if not text or listed.ndim != 1 or not 1 <= len(listed) <= MOST_SHARDS:
        raise FileFormatError(where, f"{listed.dtype} {listed.shape}", "a line for each shard")
    name = re.compile(re.escape(path.stem) + r"-\d{5}-of-\d{5}" + re.escape(path.suffix))
    found = []
    for line in StoredArray(listed)[()]:
        try:
            shard = Shard(**json.loads(line[:LONGEST_LINE]))
            good = shard.rows > 0 and type(shard.rows) is int
            good &= re.fullmatch("[0-9a-f]{64}", shard.content_digest) is not None
            good &= name.fullmatch(shard.file) is not None
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
        self.starts = [0, *accumulate(shard.rows for shard in shards)]
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
            self._arrays[number, name] = StoredArray(file[name])
        return self._arrays[number, name]

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
        self.dataset, self._files = dataset, files
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
        shard = np.searchsorted(self._files.starts, chosen, side="right") - 1
        for number in np.unique(shard).tolist():
            places = np.flatnonzero(shard == number)
            inside = chosen[places] - self._files.starts[number]
            stored = self._files.array(number, self.dataset.name)
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
