"""Make a set of rooms in shards, and go on where an earlier run was killed.

Each shard is a file of rooms, gets its name when it is complete, and holds the same bytes whoever
makes it. When all are there, the file of the set shows them as one.
"""

import os
import re
import time
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py

from scenegen.common.errors import FileFormatError, SpecError
from scenegen.common.hdf5.content import CONTENT_DIGEST, seal
from scenegen.common.hdf5.row_file import new_file, writer_name
from scenegen.common.hdf5.shards import Shard, cut, shard_name, write_virtual
from scenegen.common.manifest import (
    FORMAT,
    Manifest,
    ShardRecord,
    file_sha256,
    locked,
    manifest_path,
    read_manifest,
    shard_problem,
    write_manifest,
)
from scenegen.common.new_file import check_writable
from scenegen.description.specs import DatasetSpec, Fingerprint
from scenegen.layout import FORMAT_VERSION, TRUTH_DIGEST, columns
from scenegen.rooms.reader import RoomsFile, truth_digest
from scenegen.rooms.render import Work
from scenegen.rooms.writer import create_rooms, root_attributes


def make_shards(
    path: str | Path,
    work: Work,
    count: int,
    size: int,
    attributes: dict[str, str],
    overwrite: bool,
    progress: Callable[[int], Any],
) -> None:
    """Render scenes 0 .. count - 1 to shards of `size` scenes beside `path`, the file of the set.

    Shards that an earlier run of the same request completed are kept, if their checksums are right.
    With `overwrite` they are not.

    Raises SpecError where what is there answers another request, SceneGenError while another run
    makes this set, and OSError where something else has one of the names.
    """
    path, views = Path(path), len(work.spec.views)
    check_writable(path, overwrite=True)
    settings = {"compression": work.compression, "format_version": FORMAT_VERSION}
    settings |= {"writer": writer_name(), **attributes}
    command = settings.pop("creation_command")
    asked = Manifest(
        FORMAT, path.name, work.spec.to_json(), count, size, tuple(sorted(settings.items())),
        command, False, (),
    )  # fmt: skip
    scenes = cut(count, size)
    names = [shard_name(path, i, len(scenes)) for i in range(len(scenes))]
    with locked(path):
        manifest = _begun(path, asked, names, overwrite)
        attributes = {**attributes, "creation_command": manifest.command}  # as of earlier shards
        known = {record.file for record in manifest.shards}
        for name, some in zip(names, scenes, strict=True):
            if name not in known and _is_complete(path.with_name(name), work, some, attributes):
                manifest = manifest.with_shard(_record(path.with_name(name), some, views, 0.0))
        for record in manifest.shards:
            progress(record.rows)
        done = {record.file for record in manifest.shards}
        missing = [
            (name, some) for name, some in zip(names, scenes, strict=True) if name not in done
        ]
        write_manifest(path, manifest)
        with closing(work.in_order(some for _, some in missing)) as made:
            for name, some in missing:
                started, place = time.perf_counter(), path.with_name(name)
                with create_rooms(
                    place, work.spec, len(some), compression=work.compression, overwrite=True,
                    attributes=attributes, is_shard=True,
                ) as writer:  # fmt: skip
                    while writer.table.rows < len(some) * views:
                        rows = next(made)
                        writer.extend(rows)
                        progress(rows.count)
                seconds = round(time.perf_counter() - started, 3)
                manifest = manifest.with_shard(_record(place, some, views, seconds))
                write_manifest(path, manifest)
            next(made, None)  # there is none; so workers end by themselves
        _write_set(path, work.spec, work.compression, manifest, attributes)
        write_manifest(path, replace(manifest, complete=True))


def _begun(path: Path, asked: Manifest, names: Sequence[str], overwrite: bool) -> Manifest:
    """Return the manifest of what is there already, without shards that cannot be kept.

    Raises as `make_shards`.
    """
    place = manifest_path(path)
    if overwrite:
        _remove(path)
    elif not place.exists():
        for taken in (path, *(path.with_name(name) for name in names)):
            check_writable(taken, overwrite=False)
        return asked
    if not place.exists():
        return asked
    found = read_manifest(place)
    differences = found.differences(asked)
    if differences:
        raise SpecError(
            place, "; ".join(differences), "the same request as that of the run that began it",
            "repeat its options to go on, or start anew with --overwrite",
        )  # fmt: skip
    kept = [
        record
        for record in found.shards
        if record.file in names and shard_problem(path.parent, record) is None
    ]
    if found.complete and len(kept) == len(names):
        check_writable(path, overwrite=False)
    return replace(found, shards=tuple(kept), complete=False)


def _is_complete(place: Path, work: Work, scenes: range, attributes: dict[str, str]) -> bool:
    """Return whether a shard that the manifest lacks is as this run would make it.

    A run may be killed between the two.
    """
    try:
        with RoomsFile(place) as rooms:
            told = {**root_attributes(work.spec, len(rooms), work.compression), **attributes}
            views = len(work.spec.views)
            same = all(rooms.attributes.get(name) == value for name, value in told.items())
            return (
                same
                and len(rooms) == len(scenes) * views
                and int(rooms.read("scene_index", 0)) == scenes.start
                and not rooms.content_problems({})
            )
    except (OSError, FileFormatError):
        return False


def _remove(path: Path) -> None:
    """Remove a set: the file that shows it first, then its manifest, and its shards last."""
    path.unlink(missing_ok=True)
    manifest_path(path).unlink(missing_ok=True)
    shard = re.compile(re.escape(path.stem) + r"-\d{5}-of-\d{5}" + re.escape(path.suffix))
    for name in os.listdir(path.parent):
        if shard.fullmatch(name):
            path.with_name(name).unlink(missing_ok=True)


def _record(place: Path, scenes: range, views: int, seconds: float) -> ShardRecord:
    with h5py.File(place, "r") as file:
        digest = str(file.attrs[CONTENT_DIGEST])
    return ShardRecord(
        place.name, scenes.start, len(scenes), len(scenes) * views, place.stat().st_size,
        file_sha256(place), digest, seconds,
    )  # fmt: skip


def _write_set(
    path: Path, spec: DatasetSpec, compression: str, manifest: Manifest, attributes: dict[str, str]
) -> None:
    """Write the file that shows all shards as one; it tells of them what one file would tell."""
    shards = [Shard(one.file, one.rows, one.content_digest) for one in manifest.shards]
    views, fingerprint = len(spec.views), Fingerprint(spec)
    for shard in shards:
        with h5py.File(path.with_name(shard.file), "r") as file:
            for text in file["scene"][::views]:
                fingerprint.add(text)
    axes = {column.name: column.axes or () for column in columns(spec)}
    with new_file(path, overwrite=True) as file:
        rows = sum(shard.rows for shard in shards)
        file.attrs.update(root_attributes(spec, rows, compression), **attributes)
        write_virtual(file, path.parent, shards, axes)
        file.attrs["fingerprint"] = fingerprint.hex
        file.attrs[TRUTH_DIGEST] = truth_digest(file)
        seal(file)
