"""HDF5 files that anyone may have written: opened and read within bounds, and without links.

A file is one file: links and data sets that lead out of it are refused before they are followed.
A chunk takes no more memory than the layout says: it is inflated here, up to its size and no
further, as HDF5's own filter inflates whatever a chunk holds. Chunks that were never written are
refused, as HDF5 reads them as zeros.
"""

import errno
import math
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from h5py import h5d, h5l, h5o, h5t, h5z
from isal import isal_zlib
from numpy.typing import NDArray

from scenegen.common.errors import FileFormatError, SceneGenError, SpecError

Array = NDArray[Any]
# What h5py raises on damaged files, by the kind of damage: this tuple is the only list of them.
HDF5_ERRORS = (OSError, RuntimeError, KeyError, TypeError, ValueError, MemoryError)
MOST_OBJECTS = 10_000  # groups and data sets of a file
DEEPEST = 8  # groups within groups
MOST_ATTRIBUTES = 1_000  # of one of them
MOST_BYTES = 256 * 2**20  # to be unpacked for one row
LZF = 32000
# Names of the filters, and their places in a pipeline, each of which is taken once.
FILTERS = {
    h5z.FILTER_SHUFFLE: ("shuffle", 0),
    h5z.FILTER_DEFLATE: ("gzip", 1),
    LZF: ("lzf", 1),
    h5z.FILTER_FLETCHER32: ("fletcher32", 2),
}
_LOCKED = "another process is writing to it. Wait until it ends"
_AGAIN = "Try again, or copy the file to another disk"
_OF_SYSTEM = {
    errno.EAGAIN: _LOCKED,
    errno.EACCES: "it may not be read. Give yourself read permission",
    errno.EPERM: "it may not be read. Give yourself read permission",
    errno.EIO: f"the disk reported an error while it was read. {_AGAIN}",
    errno.ESTALE: "the network disk has replaced or removed it meanwhile. Open it again",
    errno.ENOLCK: "this disk cannot lock files. Set HDF5_USE_FILE_LOCKING=FALSE",
    errno.EMFILE: "too many files are open. Raise the limit: ulimit -n 4096",
    errno.ENFILE: "the machine has too many files open. Try again later",
    errno.ETIMEDOUT: f"the network disk did not answer. {_AGAIN}",
    errno.ENOTCONN: f"the network disk is not connected. {_AGAIN}",
}  # errors that say nothing of the file's content
CHECKSUM_BYTES = 4  # that fletcher32 adds to a chunk
TEXT_BYTES = 16  # of a text of any length, where it is stored: its length and where it lies


@dataclass(frozen=True)
class Fault:
    """Something of a file that is not followed or read.

    Attributes:
        name: of the object, without a slash before it.
        rule: in a word, as in `metrics.submissions.problems.Problem`.
        virtual: whether it is a virtual data set, which the file of a set of shards may have.
    """

    name: str
    rule: str
    found: str
    expected: str
    virtual: bool = False


def open_file(path: str | Path, kind: str) -> h5py.File:
    """Open an HDF5 file of which every object is safe to open; `kind` is what it should be.

    Raises OSError for what is no regular file, FileFormatError for one that is not HDF5, or cut
    off, or of which something leads out of the file or cannot be read within bounds.
    """
    file = open_unchecked(path, kind)
    with checking(file):
        fault = next(faults(file), None)
        if fault is not None:
            raise FileFormatError(f"{path}: {fault.name}", fault.found, fault.expected)
    return file


def open_unchecked(path: str | Path, kind: str) -> h5py.File:
    """Open an HDF5 file of which the caller opens only what `faults` does not name."""
    problems = (
        (not os.path.exists(path), errno.ENOENT, "no such file"),
        (os.path.isdir(path), errno.EISDIR, f"is a folder; name a {kind}"),
        (not os.path.isfile(path), errno.EINVAL, "is not a regular file"),
    )
    for wrong, number, text in problems:
        if wrong:
            raise OSError(number, text, str(path))
    try:
        return h5py.File(path, "r")
    except OSError as error:
        _raise_if_of_system(error, path)
        problem = f"{path}: not a readable HDF5 file ({reason(error)})"
        raise FileFormatError(problem, hint=f"name a {kind}") from error


@contextmanager
def reading(where: object) -> Iterator[None]:
    """Turn whatever HDF5 raises on a damaged file into a FileFormatError of one line.

    `where` names the file, the data set and the row as far as they are known.
    An IndexError passes: a row beyond the end is the caller's mistake, not the file's. An error of
    the system, such as a lost network disk, is an OSError: the file may be whole.
    """
    try:
        yield
    except SceneGenError:
        raise
    except HDF5_ERRORS as error:
        _raise_if_of_system(error, where)
        raise FileFormatError(f"{where}: cannot be read ({reason(error)})") from error


@contextmanager
def checking(file: h5py.File) -> Iterator[None]:
    """Close the file if the block raises an error. Raises FileFormatError as `reading`."""
    try:
        with reading(file.filename):
            yield
    except (SceneGenError, OSError):
        file.close()
        raise


def _raise_if_of_system(error: BaseException, where: object) -> None:
    """Raise an OSError that says what happened and what to do, if it was not the file's fault."""
    number = error.errno if isinstance(error, OSError) else None
    if number in _OF_SYSTEM:
        raise OSError(number, _OF_SYSTEM[number], str(where)) from error


@contextmanager
def describing(place: str) -> Iterator[None]:
    """Turn the SpecError of a stored description into a FileFormatError of its place."""
    try:
        yield
    except SpecError as error:
        where = f"{place}: {error.where}"
        raise FileFormatError(where, error.found, error.expected, error.hint) from error


def reason(error: BaseException) -> str:
    """Return what an error of HDF5 says in its innermost parentheses, on one line."""
    text = str(error.args[-1]) if error.args else type(error).__name__
    inside = text[text.find("(") + 1 : text.rfind(")")] if "(" in text else text
    return inside.split("\n")[0]


def faults(file: h5py.File) -> Iterator[Fault]:
    """Yield what must not be opened or read, following no link on the way.

    Raises whatever HDF5 raises on a damaged file.
    """
    waiting, seen = [("", file.id)], 0
    addresses: set[int] = set()
    yield from _attribute_faults("/", file.id)
    while waiting:
        prefix, group = waiting.pop()
        for raw in group:
            seen += 1
            name = f"{prefix}{raw.decode('utf-8', 'backslashreplace')}"
            if seen > MOST_OBJECTS:
                yield Fault(name, "count", f"more than {MOST_OBJECTS:,} objects", "fewer")
                return
            if group.links.get_info(raw).type != h5l.TYPE_HARD:
                yield Fault(name, "link", f"a link{_target(group, raw)}", "an object of this file")
                continue
            info = h5o.get_info(group, raw)
            if info.addr in addresses:
                continue
            addresses.add(info.addr)
            if info.type == h5o.TYPE_GROUP:
                child = h5o.open(group, raw)
                yield from _attribute_faults(name, child)
                if name.count("/") >= DEEPEST:
                    yield Fault(name, "count", f"groups {DEEPEST} deep", "fewer")
                    return
                waiting.append((f"{name}/", child))
            elif info.type == h5o.TYPE_DATASET:
                dataset = h5d.open(group, raw)
                yield from _dataset_faults(name, dataset)
                yield from _attribute_faults(name, dataset)


def _target(group: Any, raw: bytes) -> str:
    link = h5py.Group(group).get(raw, getlink=True)
    target = f" to the file {link.filename!r:.60}" if isinstance(link, h5py.ExternalLink) else ""
    return target.encode("utf-8", "backslashreplace").decode()


def _attribute_faults(name: str, item: Any) -> Iterator[Fault]:
    count = h5py.h5a.get_num_attrs(item)
    if count > MOST_ATTRIBUTES:
        expected = f"at most {MOST_ATTRIBUTES:,}"
        yield Fault(name, "attributes", f"{count} attributes", expected)


def _dataset_faults(name: str, dataset: Any) -> Iterator[Fault]:
    """Yield what is wrong with the storage of a data set, whose shape is not asked for too early.

    Asking a virtual data set for its shape would open the files that it is made of.
    """
    with storage_of(dataset) as storage:
        layout, external = storage.get_layout(), storage.get_external_count()
        chunks = storage.get_chunk() if layout == h5d.CHUNKED else ()
        used = [storage.get_filter(i)[0] for i in range(storage.get_nfilters())]
    if layout == h5d.VIRTUAL or external:
        expected = "values in this file itself"
        yield Fault(
            name, "link", "values that lie in another file", expected, layout == h5d.VIRTUAL
        )
        return
    shape, size = dataset.shape or (), stored_bytes(dataset)
    written = dataset.get_storage_size()
    if layout == h5d.CONTIGUOUS and 0 < written < math.prod(shape) * size:
        yield Fault(name, "written", f"{written} bytes for the shape {shape}", "all values")
    if layout != h5d.CHUNKED:
        if math.prod(shape) and not written and dataset.shape is not None:
            yield Fault(name, "written", f"shape {shape}, but nothing was written", "values")
        return
    slab = slab_bytes(shape, chunks, size)
    if slab > MOST_BYTES:
        found = f"chunks {chunks}, so that a row takes {slab >> 20} MiB to unpack"
        expected = f"at most {MOST_BYTES >> 20} MiB (store one row to a chunk)"
        yield Fault(name, "chunks", found, expected)
    filters = [FILTERS.get(code, (f"filter {code}", -1)) for code in used]
    places = [place for _, place in filters]
    if -1 in places or places != sorted(set(places)):
        expected = "shuffle or not, gzip or lzf or neither, fletcher32 or not, in this order"
        yield Fault(name, "filters", " and ".join(text for text, _ in filters), expected)
    expected_chunks = math.prod(-(-s // c) for s, c in zip(shape, chunks, strict=True))
    there = dataset.get_num_chunks()
    if there < expected_chunks:
        found = f"{expected_chunks - there} of {expected_chunks} chunks that were never written"
        if not there:
            found = f"shape {shape}, but nothing was written"
        yield Fault(name, "written", found, "values in all of them")
    elif not used and written != there * math.prod(chunks) * size:
        found = f"{written} bytes in {there} chunks of {math.prod(chunks) * size}"
        yield Fault(name, "written", found, "chunks of the size that their shape has")


@contextmanager
def storage_of(dataset: Any) -> Iterator[Any]:
    """Give the creation properties of a low-level data set, and close them after the block.

    HDF5 crashes as the process ends where those of a virtual data set are still open then, held by
    a traceback perhaps. `Dataset.is_virtual` and the like of h5py keep them with the data set.
    """
    storage = dataset.get_create_plist()
    try:
        yield storage
    finally:
        storage.close()


def is_virtual(dataset: h5py.Dataset) -> bool:
    """Return whether the values of a data set lie in others."""
    with storage_of(dataset.id) as storage:
        return bool(storage.get_layout() == h5d.VIRTUAL)


def virtual_sources(dataset: h5py.Dataset) -> list[tuple[str, str, int, int]]:
    """Return what a virtual data set shows: files, data sets in them, first row here, and rows.

    A source of which not all rows are shown in their order has -1 rows.
    """
    with storage_of(dataset.id) as listed:
        mapped = [
            (
                (listed.get_virtual_filename(i), listed.get_virtual_dsetname(i)),
                listed.get_virtual_vspace(i),
                listed.get_virtual_srcspace(i),
            )
            for i in range(listed.get_virtual_count())
        ]
    sources = []
    for name, here, there in mapped:
        (first, *low), (last, *high) = here.get_select_bounds()
        rows, shape = last - first + 1, here.get_simple_extent_dims()[1:]
        whole = not any(low) and tuple(high) == tuple(size - 1 for size in shape)
        whole &= here.get_select_npoints() == rows * math.prod(shape)
        whole &= there.get_select_type() == h5py.h5s.SEL_ALL
        sources.append((*name, first, rows if whole else -1))
    return sources


def stored_bytes(dataset: Any) -> int:
    """Return the bytes that an element of a low-level data set takes in a chunk."""
    of_any_length = h5py.check_vlen_dtype(dataset.dtype) is not None
    return TEXT_BYTES if of_any_length else int(dataset.get_type().get_size())


def slab_bytes(shape: tuple[int, ...], chunks: tuple[int, ...], itemsize: int) -> int:
    """Return the bytes of all chunks that one row touches."""
    padded = [-(-s // c) * c for s, c in zip(shape[1:], chunks[1:], strict=True)]
    return int(chunks[0] * math.prod(padded) * itemsize)


class StoredArray:
    """A data set that `faults` does not name; its rows are read within the bounds of its chunks."""

    def __init__(self, dataset: h5py.Dataset) -> None:
        self.dataset = dataset
        self.shape: tuple[int, ...] = dataset.shape or ()
        self.dtype, self.attrs = dataset.dtype, dataset.attrs
        with storage_of(dataset.id) as storage:
            self._filters = [storage.get_filter(i)[0] for i in range(storage.get_nfilters())]
        plain = {h5z.FILTER_SHUFFLE, h5z.FILTER_DEFLATE}.issuperset(self._filters)
        as_stored = self.dtype.kind in "iuf" and dataset.id.get_type() == h5t.py_create(self.dtype)
        self._own = plain and as_stored and dataset.chunks == (1, *self.shape[1:])
        self._checked: set[tuple[int, ...]] = set()

    def __len__(self) -> int:
        return int(self.shape[0])

    def pieces(self) -> Iterator[h5py.Dataset]:
        """Yield the data set that holds the values."""
        yield self.dataset

    def __getitem__(self, rows: int | slice | tuple[()]) -> Any:
        """Return one row, some, or all for (). Raises IndexError, and as HDF5 does on damage."""
        if self.dataset.chunks is None:
            return self.dataset[rows]
        if isinstance(rows, (int, np.integer)):
            row = range(len(self))[rows]
            return self[row : row + 1][0]
        chosen = range(len(self))[slice(None) if isinstance(rows, tuple) else rows]
        if self._own and chosen.step > 0:
            values = np.empty((len(chosen), *self.shape[1:]), self.dtype)
            for place, row in enumerate(chosen):
                values[place] = self._row(row)
            return values
        for start in self._touched(chosen):
            if start not in self._checked:
                self._unpacked(start)
                self._checked.add(start)
        return self.dataset[rows]

    def _row(self, row: int) -> Any:
        """Return one row of a data set that stores each as a chunk, perhaps one not to write to."""
        raw = self._unpacked((row,) + (0,) * (len(self.shape) - 1))
        return np.frombuffer(raw, self.dtype).reshape(self.shape[1:])

    def _touched(self, rows: range) -> Iterator[tuple[int, ...]]:
        """Yield where the chunks begin that hold some rows."""
        first, *others = self.dataset.chunks
        starts = dict.fromkeys(row // first * first for row in rows)
        spans = [range(0, s, c) for s, c in zip(self.shape[1:], others, strict=True)]
        for start in starts:
            for index in np.ndindex(*(len(span) for span in spans)):
                yield (start, *(span[i] for span, i in zip(spans, index, strict=True)))

    def _unpacked(self, start: tuple[int, ...]) -> bytes:
        """Return the bytes of a chunk; those of lzf as they are stored.

        Raises ValueError where they unpack to more or fewer than the chunk has: HDF5 would take any
        memory for more, and return whatever its memory held before for fewer.
        """
        size = math.prod(self.dataset.chunks) * stored_bytes(self.dataset.id)
        mask, raw = self.dataset.id.read_direct_chunk(start)
        # A filter that did not make a chunk smaller was left out of it, as its mask says.
        used = [code for i, code in enumerate(self._filters) if not mask >> i & 1]
        if h5z.FILTER_FLETCHER32 in used:
            raw = raw[:-CHECKSUM_BYTES]
        length = len(raw)
        if h5z.FILTER_DEFLATE in used:
            raw = _inflated(raw, size)
            length = len(raw)
        elif LZF in used:
            length = _lzf_length(raw)
        if length != size:
            found = "more" if length > size else f"{length} bytes"
            raise ValueError(f"{found} in a chunk of {size} bytes")
        if h5z.FILTER_SHUFFLE in used and self._own:
            raw = np.frombuffer(raw, np.uint8).reshape(self.dtype.itemsize, -1).T.tobytes()
        return bytes(raw)


def _inflated(data: bytes, most: int) -> bytes:
    """Return what gzip's stream holds, a byte more than `most` at most."""
    unpacker, raw, said = isal_zlib.decompressobj(), b"", ""
    try:
        raw = unpacker.decompress(data, most + 1)
    except isal_zlib.error as error:  # type: ignore[misc]
        said = str(error)
    if said:  # without the error itself, which cannot be pickled
        raise ValueError(f"a chunk that is not compressed by gzip: {said}")
    return raw if unpacker.eof else raw + b" "  # so that its length is wrong, too


def _lzf_length(data: bytes) -> int:
    """Return how many bytes an LZF stream unpacks to: runs of bytes, and copies of earlier ones."""
    length = place = 0
    while place < len(data):
        control = data[place]
        if control < 32:
            length, place = length + control + 1, place + control + 2
        else:
            long = control >= 224 and place + 1 < len(data)
            length += (control >> 5) + 2 + (data[place + 1] if long else 0)
            place += 3 if control >= 224 else 2
    return length
