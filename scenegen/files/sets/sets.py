"""Write the files of a set: whole ones, shards, those that show shards as one, and merged ones."""

import hashlib
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path, PurePosixPath
from typing import Any

import h5py
import numpy as np

from scenegen.common.errors import FileFormatError
from scenegen.files.content import CONTENT_DIGEST, SHA256, dataset_digest, seal
from scenegen.files.new_file import written_beside
from scenegen.files.row_file import new_hdf5
from scenegen.files.schema import Column, name_axes
from scenegen.files.sets.plan import Part, Piece, Sheet, whole
from scenegen.files.sets.shards import ROW_DIGESTS, SHARDS, OpenFile, Shard, opened
from scenegen.files.sets.workers import in_threads
from scenegen.files.table import (
    PackedRows,
    Table,
    extend_together,
    pack_rows,
    packing_threads,
)

Packed = Sequence[PackedRows]  # as many rows for each table of a part
Progress = Callable[[int], Any]
COPIED_ROWS = 64  # that a merge reads and packs in one go


def write_piece(
    paths: Sequence[Path],
    piece: Piece,
    rows: Iterator[Packed],
    compression: str,
    progress: Progress,
) -> None:
    """Write the files of a piece with the next rows of `rows`.

    The bytes depend on the rows alone, not on how many come at a time. `progress` is called with
    the number of rows that were written.
    """
    with ExitStack() as writing:
        files = [writing.enter_context(new_hdf5(path)) for path in paths]
        attributes = [dict(of_file) for of_file in piece.files.values()]
        row_digests: list[dict[str, bytes]] = [{} for _ in files]
        for block in piece.blocks:
            part = block.part
            tables = _tables(files, part, block.rows, compression, piece.is_shard)
            while tables[0].rows < block.rows:
                packed = next(rows)
                extend_together(tables, packed)
                progress(packed[0].count)
            _add_marks(attributes, part, _digests(tables))
            for sheet, table in zip(part.sheets, tables, strict=True):
                row_digests[sheet.file] |= table.row_digests()
        for file, of_file, of_rows in zip(files, attributes, row_digests, strict=True):
            if piece.is_shard:
                _write_row_digests(file, of_rows)
            _seal(file, of_file)


def write_view(
    paths: Sequence[Path],
    piece: Piece,
    shards: Sequence[Piece],
    made: Mapping[str, Path],
    compression: str,
) -> None:
    """Write files that show their shards as one; they tell what whole files tell.

    Args:
        piece: the whole.
        made: the complete shards, by the names that they will have.
    """
    attributes = [dict(of_file) for of_file in piece.files.values()]
    lists: list[list[Shard]] = [[] for _ in paths]
    with ExitStack() as writing:
        files = [writing.enter_context(new_hdf5(path)) for path in paths]
        for part in (block.part for block in piece.blocks):
            of_part = [shard for shard in shards if shard.blocks[0].part.name == part.name]
            if not of_part:
                digests = _digests(_tables(files, part, 0, compression))
            else:
                digests = {}
                for number, file in enumerate(files):
                    named = {[*shard.files][number]: shard.rows for shard in of_part}
                    listed, joined = _joined(named, made, part.name)
                    lists[number] += listed
                    for sheet in part.sheets:
                        if sheet.file == number:
                            digests |= _write_virtual_columns(file, sheet, listed, joined)
            _add_marks(attributes, part, digests)
        for file, listed, of_file in zip(files, lists, attributes, strict=True):
            _write_list(file, listed)
            _seal(file, of_file)


def _joined(
    rows: Mapping[str, int], made: Mapping[str, Path], part: str
) -> tuple[list[Shard], dict[str, tuple[str, Any]]]:
    """Return the shards of a part of a file, given the rows of each, and what is known of columns.

    That is by name the `column_digest` over all shards, and the type. Texts are as long as in the
    shard where they are longest.
    """
    listed, hashes, types = [], dict[str, "hashlib._Hash"](), dict[str, Any]()
    for name, count in rows.items():
        with opened(made[name]) as file:
            digest = str(file.attrs[CONTENT_DIGEST])
            listed.append(Shard(PurePosixPath(name).name, count, digest, part))
            digests = file[ROW_DIGESTS]
            values = digests[()]
            for i, column in enumerate(digests.attrs["names"]):
                hashes.setdefault(column, hashlib.sha256()).update(values[:, i].tobytes())
                dtype = file[column].dtype
                longest = max(types.get(column, dtype), dtype, key=lambda kind: kind.itemsize)
                types[column] = longest
    return listed, {name: (digest.hexdigest(), types[name]) for name, digest in hashes.items()}


def _write_virtual_columns(
    file: h5py.File,
    sheet: Sheet,
    shards: Sequence[Shard],
    joined: Mapping[str, tuple[str, Any]],
) -> dict[str, str]:
    """Write columns that show those of all shards; return their digests by name."""
    group, digests = _group(file, sheet), {}
    for path, column in sheet.paths.items():
        digest, dtype = joined[path]
        dataset = _virtual_dataset(group, column, path, shards, dtype)
        dataset.attrs[SHA256] = digests[column.name] = digest
    return digests


def _virtual_dataset(
    group: h5py.Group, column: Column, path: str, shards: Sequence[Shard], dtype: Any
) -> h5py.Dataset:
    """Write a virtual data set that shows a column of all shards."""
    layout = h5py.VirtualLayout((sum(shard.rows for shard in shards), *column.shape), dtype)
    layout.dcpl.set_obj_track_times(False)  # the same bytes at any time
    start = 0
    for shard in shards:
        source = h5py.VirtualSource(shard.file, path, (shard.rows, *column.shape))
        layout[start : start + shard.rows] = source
        start += shard.rows
    fill = np.nan if dtype.kind == "f" else None
    dataset = group.create_virtual_dataset(column.name, layout, fillvalue=fill)
    dataset.attrs.update(column.attributes)
    if column.axes is not None:
        name_axes(group, dataset, ("row", *column.axes))
    return dataset


def merge_file(
    source: OpenFile,
    out: str | Path,
    parts: Sequence[Part],
    compression: str,
    overwrite: bool = False,
    progress: Progress = lambda rows: None,
) -> None:
    """Write the rows of a file, or of a set of shards, to one file.

    It has the bytes that the command which made the set would have written to one file.

    Args:
        source: that a reader has checked.
        parts: what it holds, without marks, which are copied.

    Raises as `written_beside`, and FileFormatError where a value is not the one that was written to
    its shard. Nothing is then left.
    """
    attributes = {k: v for k, v in source.file.attrs.items() if k != CONTENT_DIGEST}
    piece = whole({source.path.name: attributes}, parts)
    stored = {n: source.array(n) for part in parts for sheet in part.sheets for n in sheet.paths}

    def packed(task: tuple[Part, slice]) -> Packed:
        part, rows = task
        return [
            pack_rows(
                {column.name: stored[path][rows] for path, column in sheet.paths.items()},
                sheet.columns,
                compression,
            )
            for sheet in part.sheets
        ]

    tasks = (
        (block.part, slice(first, min(first + COPIED_ROWS, block.rows)))
        for block in piece.blocks
        for first in range(0, block.rows, COPIED_ROWS)
    )
    threads = packing_threads()
    with written_beside(out, overwrite) as path:
        copied = in_threads(packed, tasks, threads, 4 * threads)
        write_piece([path], piece, copied, compression, progress)
        with h5py.File(path) as file:
            for name, array in stored.items():
                if file[name].attrs[SHA256] != array.attrs[SHA256]:
                    where = f"{source.path}: {name}: values are not those that were written"
                    raise FileFormatError(where, hint="verify says which")


def _tables(
    files: Sequence[h5py.File], part: Part, rows: int, compression: str, row_digests: bool = False
) -> list[Table]:
    """Create the tables of a part, for so many rows each."""
    groups = [_group(files[sheet.file], sheet) for sheet in part.sheets]
    return [
        Table(group, sheet.columns, rows, compression, row_digests)
        for group, sheet in zip(groups, part.sheets, strict=True)
    ]


def _group(file: h5py.File, sheet: Sheet) -> h5py.Group:
    group = file.require_group(sheet.group or "/")
    group.attrs.update(sheet.attributes)
    return group


def _digests(tables: Sequence[Table]) -> dict[str, str]:
    """Return the digests of all columns by name."""
    columns = [column for table in tables for column in table.datasets.items()]
    return {name: dataset.attrs[SHA256] for name, dataset in columns}


def _add_marks(
    attributes: Sequence[dict[str, Any]], part: Part, digests: Mapping[str, str]
) -> None:
    """Add the marks of a part to the root attributes of its files."""
    for mark in part.marks:
        for number in mark.files:
            attributes[number][mark.name] = mark.value(digests)


def _seal(file: h5py.File, attributes: Mapping[str, Any]) -> None:
    """Write root attributes, in an order that does not depend on who wrote them, and the digest."""
    file.attrs.update(sorted(attributes.items()))
    seal(file)


def _write_row_digests(file: h5py.File, digests: Mapping[str, bytes]) -> None:
    """Write the digests of all rows of a shard, 32 bytes each, by name of the data set."""
    names = sorted(digests)
    rows = [np.frombuffer(digests[name], np.uint8).reshape(-1, 32) for name in names]
    values = np.stack(rows, axis=1)
    dataset = file.create_dataset(ROW_DIGESTS, data=values)
    dataset.attrs["names"] = names
    dataset.attrs["meaning"] = "SHA-256 of each row of each data set, as `sha256` is made of them"
    dataset.attrs[SHA256] = dataset_digest(values)


def _write_list(file: h5py.File, shards: Sequence[Shard]) -> None:
    """Write the list of all shards of a set, those of each part in their order."""
    lines = np.array([json.dumps(vars(shard)).encode() for shard in shards])
    dtype = h5py.string_dtype(length=lines.dtype.itemsize)
    listed = file.create_dataset(SHARDS, data=lines.astype(dtype))
    listed.attrs["meaning"] = "the files beside this one that hold the values, in their order"
    listed.attrs[SHA256] = dataset_digest(lines)
