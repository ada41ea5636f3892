"""Columns of HDF5 data sets, written in order, many rows at a time.

Images are compressed here, by isal, and handed to HDF5 as finished chunks: that is faster than its
own filter and any HDF5 library reads it.

Texts have the length of the longest one of their column, as PyTables reads no others. It is known
at the end, so they are kept until then.
"""

import os
import struct
from collections import deque
from collections.abc import Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache
from typing import Any

import h5py
import numpy as np
from isal import isal_zlib
from numpy.typing import NDArray

from scenegen.common.cgroup import processors
from scenegen.common.errors import SpecError
from scenegen.common.names import check_choice
from scenegen.files.content import SHA256, ColumnDigest, row_digest
from scenegen.files.schema import Column, name_axes

Array = NDArray[Any]
COMPRESSIONS = ("gzip", "lzf", "none")
DEFLATE_LEVEL = 1
STORED = 8  # bytes at the start of a chunk that are not compressed
PACK_ROWS = 4  # whose images a thread compresses in one go
MOST_PACKING = 128  # rows that may wait to be written; bounds the memory
MOST_PACKERS = 8  # threads that compress
BLOCK_ROWS = 1024  # rows of the small datasets that are kept and written together
TEXT_BYTES = 2**20  # of a chunk of texts, at most, unless one row has more
Rows = Mapping[str, Sequence[Any] | Array]  # values of as many rows for each column


class Table:
    """Columns of equal length in one HDF5 group, filled in order.

    The bytes written depend on the rows alone, not on how many are appended at a time. Chunks are
    compressed by threads of their own, which the GIL does not hold up, so rows may be written
    after `append` returns; they must not change then. When the last row is appended, all are
    written, and each dataset gets its digest (`content.column_digest`) as an attribute.

    Attributes:
        count, rows: numbers of rows, in all and written so far.
        file: that holds them.
        columns, compression: as given.
        datasets: by name; those of texts are there when all rows are written.
    """

    def __init__(
        self,
        group: h5py.Group,
        columns: Sequence[Column],
        count: int,
        compression: str = "gzip",
        row_digests: bool = False,
    ) -> None:
        """Create the datasets; with `row_digests` those of all rows are kept in memory.

        Raises SpecError for an unknown compression or a negative count.
        """
        check_choice("compression", compression, COMPRESSIONS)
        if count < 0:
            raise SpecError("count", count, "0 or more")
        self.count, self.rows, self._given = count, 0, 0
        self.columns, self.compression = tuple(columns), compression
        self._images = [column for column in columns if column.own_chunk]
        self.datasets = {
            column.name: self._create(group, column) for column in columns if column.dtype != "text"
        }
        self._block: dict[str, list[Any]] = {c.name: [] for c in columns if not c.own_chunk}
        self._texts: dict[str, list[bytes]] = {c.name: [] for c in columns if c.dtype == "text"}
        self._group, self.file = group, group.file
        self._digests = {column.name: ColumnDigest(row_digests) for column in columns}
        self._packing: deque[Future[PackedRows]] = deque()
        if not count:
            self._finish()

    def append(self, row: Mapping[str, Any]) -> None:
        """Write the next row: one value for each column."""
        self.extend({name: [value] for name, value in row.items()})

    def extend(self, rows: "Rows") -> None:
        """Write the next rows, at least one: as many values for each column."""
        count = len(next(iter(rows.values())))
        for first in range(0, count, PACK_ROWS):
            some = {name: values[first : first + PACK_ROWS] for name, values in rows.items()}
            pack = _threads(os.getpid()).submit
            self._packing.append(pack(pack_rows, some, self.columns, self.compression))
        self._given += count
        self.write_packed(0 if self._given == self.count else MOST_PACKING)

    def write_packed(self, waiting: int = 0) -> None:
        """Write rows until about so many are left; needed only where fewer than `count` come."""
        while len(self._packing) * PACK_ROWS > waiting:
            self.extend_packed(self._packing.popleft().result())

    def extend_packed(self, packed: "PackedRows") -> None:
        """Write the next rows, which `pack_rows` packed for the columns of this table."""
        first = 0
        while first < packed.count:
            # Up to the end of a block, so that the file's layout depends on the rows alone.
            end = min(packed.count, first + BLOCK_ROWS - self.rows % BLOCK_ROWS)
            for images in packed.images[first:end]:
                self._write_chunks(images)
                self.rows += 1
            for name, values in packed.others.items():
                self._block[name].extend(values[first:end])
            first = end
            if self.rows % BLOCK_ROWS == 0 or self.rows == self.count:
                self._flush()
        if self.rows == self.count:
            self._finish()

    def _write_chunks(self, images: Sequence[tuple[bytes, Any]]) -> None:
        for column, (digest, chunk) in zip(self._images, images, strict=True):
            self._digests[column.name].add(digest)
            dataset = self.datasets[column.name]
            if self.compression == "lzf":
                dataset[self.rows] = chunk
            else:
                dataset.id.write_direct_chunk((self.rows, *(0 for _ in column.shape)), chunk)

    def _finish(self) -> None:
        """Write what is written when all rows are there: texts, and the digests."""
        for column in self.columns:
            if column.dtype == "text":
                self.datasets[column.name] = self._write_texts(column)
        for name, digest in self._digests.items():
            self.datasets[name].attrs[SHA256] = digest.hex

    def row_digests(self) -> dict[str, bytes]:
        """Return the digests of all rows, 32 bytes each, by path of the data set in its file."""
        kept = {self.datasets[name].name: digest.rows for name, digest in self._digests.items()}
        return {name.lstrip("/"): bytes(rows or b"") for name, rows in kept.items()}

    def _write_texts(self, column: Column) -> h5py.Dataset:
        """Write a column of texts, padded with zeros to the longest one."""
        texts = self._texts.pop(column.name)
        values = np.array(texts, f"S{max(1, *map(len, texts), 1)}")
        values = values.reshape(self.count, *column.shape)
        rows = max(1, TEXT_BYTES // values[:1].nbytes) if self.count else 1
        rows = min(self.count, BLOCK_ROWS, rows)
        dtype = h5py.string_dtype(length=values.dtype.itemsize)
        dataset = self._create(self._group, column, dtype, rows)
        for start in range(0, self.count, rows or 1):
            if self.compression == "gzip":
                chunk = np.zeros((rows, *column.shape), values.dtype)
                some = values[start : start + rows]
                chunk[: len(some)] = some
                dataset.id.write_direct_chunk((start, *(0 for _ in column.shape)), deflated(chunk))
            else:
                dataset[start : start + rows] = values[start : start + rows].astype(dtype)
        return dataset

    def _create(
        self, group: h5py.Group, column: Column, dtype: Any = None, chunk: int = 0
    ) -> h5py.Dataset:
        """Create a data set; `dtype` and `chunk` rows are those of texts."""
        options: dict[str, Any] = {}
        if self.count:
            chunk = chunk or (1 if column.own_chunk else min(self.count, BLOCK_ROWS))
            options["chunks"] = (chunk, *column.shape)
        if self.count and (column.own_chunk or dtype) and self.compression != "none":
            options["compression"] = self.compression
            options["shuffle"] = dtype is None and _is_shuffled(column)
            if self.compression == "gzip":
                options["compression_opts"] = DEFLATE_LEVEL
        dtype = dtype or column.dtype
        dataset = group.create_dataset(column.name, (self.count, *column.shape), dtype, **options)
        dataset.attrs.update(column.attributes)
        if column.axes is not None:
            name_axes(group, dataset, ("row", *column.axes))
        return dataset

    def _flush(self) -> None:
        for name, rows in self._block.items():
            if rows:
                if name in self._texts:
                    values = np.array(rows, object)
                    self._texts[name] += [_utf8(text) for text in values.reshape(-1).tolist()]
                else:
                    dataset = self.datasets[name]
                    values = np.stack(rows).astype(dataset.dtype)
                    dataset[self.rows - len(rows) : self.rows] = values
                self._digests[name].update(values)
                rows.clear()


@dataclass(frozen=True, eq=False)
class PackedRows:
    """Rows ready to be written; other processes may have made them.

    Attributes:
        count: number of rows.
        images: of each row, the digest and the chunk's bytes of each column with own chunks.
        others: values of the other columns by name.
    """

    count: int
    images: list[list[tuple[bytes, Any]]]
    others: Rows

    def row(self, i: int) -> "PackedRows":
        """Return one of the rows."""
        others = {name: values[i : i + 1] for name, values in self.others.items()}
        return PackedRows(1, self.images[i : i + 1], others)


def extend_together(tables: Sequence[Table], rows: Sequence[PackedRows]) -> None:
    """Write the next rows of several tables of one file.

    HDF5 places what has a chunk of its own in the order of writing. So where several tables have
    such columns, they are written row by row: the bytes do not depend on how many come at a time.
    """
    if sum(any(column.own_chunk for column in table.columns) for table in tables) < 2:
        for table, some in zip(tables, rows, strict=True):
            table.extend_packed(some)
        return
    for i in range(rows[0].count):
        for table, some in zip(tables, rows, strict=True):
            table.extend_packed(some.row(i))


def pack_rows(rows: Rows, columns: Sequence[Column], compression: str) -> PackedRows:
    """Compress the images of rows, and compute their digests."""
    count = len(next(iter(rows.values())))
    images: list[list[tuple[bytes, Any]]] = [[] for _ in range(count)]
    for column in columns:
        for row, value in zip(images, rows[column.name], strict=True) if column.own_chunk else ():
            raw = np.ascontiguousarray(value, column.dtype)
            packed: Any = raw  # for lzf, which h5py packs
            if compression == "gzip":
                plain = shuffle_bytes(raw) if _is_shuffled(column) else raw
                packed = deflated(plain)
            elif compression == "none":
                packed = raw.tobytes()
            row.append((row_digest(raw), packed))
    others = {column.name: rows[column.name] for column in columns if not column.own_chunk}
    return PackedRows(count, images, others)


def _utf8(text: str | bytes) -> bytes:
    return text.encode() if isinstance(text, str) else bytes(text)


def _is_shuffled(column: Column) -> bool:
    return column.shuffle and np.dtype(column.dtype).itemsize > 1


def packing_threads(workers: int = 1) -> int:
    """Return how many threads should pack rows in each of so many worker processes."""
    return max(1, min(MOST_PACKERS, processors() // workers))


@cache
def _threads(_pid: int) -> ThreadPoolExecutor:
    """Return this process's threads; those of a parent do not live on in a forked child."""
    return ThreadPoolExecutor(packing_threads(), thread_name_prefix="pack")


def deflated(values: Array) -> bytes:
    """Compress an array's bytes to a zlib stream, the same bytes in every process and thread.

    ISA-L's `compress` hashes the address of its state where it begins without history (in isal
    1.9.1, `write_first_byte` of `isal_deflate_icf_body_hash_hist_04`), so that some 1 in 10,000 of
    its outputs depends on where the stack lies. Here the first bytes are stored, and are history.
    """
    data = np.ascontiguousarray(values).data.cast("B")
    first = bytes(data[:STORED])
    header = b"\x78\x01\x00" + struct.pack("<HH", len(first), 0xFFFF ^ len(first))
    packer = isal_zlib.compressobj(DEFLATE_LEVEL, isal_zlib.DEFLATED, -15, zdict=first)
    body = packer.compress(data[STORED:]) + packer.flush()
    return header + first + body + struct.pack(">I", isal_zlib.adler32(data))


def shuffle_bytes(values: Array) -> Array:
    """Apply HDF5's shuffle filter: first bytes of all elements, then all second bytes, ..."""
    flat = values.reshape(-1)
    size = flat.dtype.itemsize
    if size not in (2, 4, 8):
        rows = flat.view(np.uint8).reshape(-1, size)
        return np.ascontiguousarray(rows.T)
    # Half the time of a transposed copy: whole numbers are shifted, and cut to their last bytes.
    numbers = flat.view(f"<u{size}")
    shuffled = np.empty((size, len(flat)), np.uint8)
    for i, row in enumerate(shuffled):
        np.copyto(row, numbers >> numbers.dtype.type(8 * i), casting="unsafe")
    return shuffled
