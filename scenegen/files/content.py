"""Digests of what HDF5 files hold: of rows, of data sets, and of a file with its attributes.

The digest of a data set is the SHA-256 of the SHA-256s of its rows, so that several processes can
read rows in any order and still tell the digest of the whole. With plain h5py it is

    hashlib.sha256(b"".join(hashlib.sha256(row.tobytes()).digest() for row in file["depth"]))

It does not depend on how the values are stored (chunks, compression).
"""

import hashlib
import math
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np

SHA256 = "sha256"  # attribute of each data set
CONTENT_DIGEST = "content_digest"  # attribute of the root
BLOCK_BYTES = 2**24  # of a data set that are in memory at once


class ColumnDigest:
    """The digest of a data set whose rows are given one after another, in their order.

    Attributes:
        rows: the digests of all rows, 32 bytes each; None if they are not kept.
    """

    def __init__(self, keep_rows: bool = False) -> None:
        self._hash = hashlib.sha256()
        self.rows = bytearray() if keep_rows else None

    def update(self, rows: Iterable[Any]) -> None:
        """Take the next rows."""
        if isinstance(rows, np.ndarray) and rows.dtype.kind in "biufc" and rows.size:
            data = _bytes(rows)  # of all rows at once: a file has many small columns
            row = len(data) // len(rows)
            for start in range(0, len(data), row):
                self.add(hashlib.sha256(data[start : start + row]).digest())
        else:
            for values in rows:
                self.add(row_digest(values))

    def add(self, digest: bytes) -> None:
        """Take the next row's `row_digest`."""
        self._hash.update(digest)
        if self.rows is not None:
            self.rows += digest

    @property
    def hex(self) -> str:
        """The digest of the rows so far."""
        return self._hash.hexdigest()


def row_digest(values: Any) -> bytes:
    """Return the SHA-256 of the values of one row.

    Numbers count as their bytes in C order, little-endian; each text as its UTF-8 and a zero byte.
    """
    return hashlib.sha256(_bytes(values)).digest()


def column_digest(rows: Iterable[bytes]) -> str:
    """Return the digest of a data set, as hex, from the `row_digest`s of all its rows.

    They must be in the order of the rows: in another order they give another digest.
    """
    return hashlib.sha256(b"".join(rows)).hexdigest()


def joint_digest(digests: Mapping[str, str]) -> str:
    """Return the SHA-256, as hex, of a line `name digest` for each data set, sorted by name."""
    lines = (f"{name} {digest}\n" for name, digest in sorted(digests.items()))
    return hashlib.sha256("".join(lines).encode()).hexdigest()


def fingerprint(request: str, digests: Mapping[str, str]) -> str:
    """Return the SHA-256, as hex, of a request and of the data sets that say how it was answered.

    It does not depend on how values are stored, or on the machine that rendered.
    """
    return joint_digest({"request": hashlib.sha256(request.encode()).hexdigest(), **digests})


def file_sha256(path: Path) -> str:
    """Return the SHA-256 of all bytes of a file, as hex. Raises OSError."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def seal(file: h5py.File) -> None:
    """Write `content_digest` to a file in which each data set has its attribute `sha256`."""
    file.attrs[CONTENT_DIGEST] = content_digest(file)


def content_digest(file: h5py.File) -> str:
    """Return the SHA-256, as hex, of every name, type, shape and attribute of a file but its own.

    The values of the data sets count through their attribute `sha256`, which
    `rows.content_problems` checks. Raises whatever HDF5 raises on a damaged file
    (`input_file.HDF5_ERRORS`).
    """
    lines = []
    for name, item in (("/", file), *_objects(file)):
        kind = f"{item.dtype.str} {item.shape}" if isinstance(item, h5py.Dataset) else "group"
        lines.append(f"{name} {kind}".encode())
        for key in sorted(item.attrs):
            if (name, key) != ("/", CONTENT_DIGEST):
                value = b"".join(_described(item.attrs[key], file))
                lines.append(f"{name}@{key} ".encode() + hashlib.sha256(value).digest())
    return column_digest(hashlib.sha256(line).digest() for line in lines)


def datasets(file: h5py.File) -> list[tuple[str, h5py.Dataset]]:
    """Return each data set of a file with the first of its names, in the order of these."""
    names: dict[h5py.Dataset, str] = {}
    for name, item in _objects(file):
        if isinstance(item, h5py.Dataset):
            names.setdefault(item, name)
    return [(name, dataset) for dataset, name in names.items()]


def dataset_digest(dataset: Any) -> str:
    """Return the digest of a data set, or of what is read as one (a `StoredArray`, an array).

    Raises whatever HDF5 raises where it is damaged.
    """
    if not dataset.shape:
        return column_digest([row_digest(dataset[()])])
    digest = ColumnDigest()
    count, *row = dataset.shape
    step = max(1, BLOCK_BYTES // max(1, math.prod(row) * dataset.dtype.itemsize))
    for start in range(0, count, step):
        digest.update(dataset[start : start + step])
    return digest.hex


def _objects(file: h5py.File) -> list[tuple[str, Any]]:
    """Return every name in a file and its object, sorted by name.

    An object may have several names; a group that has several is entered by one of them.
    """
    objects, groups, waiting = [], {file["/"]}, [("", file["/"])]
    while waiting:
        prefix, group = waiting.pop()
        for key, item in group.items():
            objects.append((f"{prefix}{key}", item))
            if isinstance(item, h5py.Group) and item not in groups:
                groups.add(item)
                waiting.append((f"{prefix}{key}/", item))
    return sorted(objects, key=lambda pair: pair[0])


def _bytes(values: Any) -> bytes | memoryview:
    if isinstance(values, str):
        return values.encode() + b"\0"
    if isinstance(values, bytes):  # as h5py reads texts
        return values + b"\0"
    array = np.asarray(values)
    if array.dtype.kind in "OUS":
        parts = array.reshape(-1).tolist()
        kinds = (str, bytes, np.ndarray)
        return b"".join(_bytes(x) if isinstance(x, kinds) else repr(x).encode() for x in parts)
    numbers = np.ascontiguousarray(array, array.dtype.newbyteorder("<"))
    return numbers.reshape(-1).view(np.uint8).data


def _described(value: Any, file: h5py.File) -> Iterator[bytes | memoryview]:
    """Yield an attribute's kind and value; references count as the names that they point to."""
    if isinstance(value, h5py.Reference):
        yield b"to " + (h5py.h5r.get_name(value, file.id) or b"nothing") + b"\0"
    elif isinstance(value, (str, bytes)):
        yield b"text "
        yield _bytes(value)
    elif isinstance(value, h5py.Empty):
        yield b"empty"
    else:
        array = np.asarray(value)
        if array.dtype.kind in "OV":
            yield f"{array.shape} ".encode()
            for part in array.reshape(-1).tolist():
                parts = part if isinstance(part, (tuple, np.ndarray)) else (part,)
                for member in parts:
                    yield from _described(member, file)
        else:
            yield f"{array.dtype.str} {array.shape} ".encode()
            yield _bytes(array)
