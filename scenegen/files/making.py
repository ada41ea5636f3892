"""Make the files of a set, and go on where an earlier run was killed.

Each file gets its name when it is complete, and holds the same bytes whoever makes it. A file that
was completed but is not in the manifest, as the run was killed right then, is made again.
"""

import platform
import time
from collections.abc import Callable, Generator, Sequence
from contextlib import closing, nullcontext, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

from scenegen.common.errors import FileFormatError, SceneGenError, SpecError
from scenegen.files.content import CONTENT_DIGEST
from scenegen.files.manifest import (
    Manifest,
    ShardRecord,
    file_sha256,
    read_manifest,
    shard_problem,
    write_manifest,
)
from scenegen.files.new_file import check_writable
from scenegen.files.places import check_store, is_remote, listing
from scenegen.files.run_lock import run_lock
from scenegen.files.shards import opened, set_name
from scenegen.files.workers import in_threads, processors
from scenegen.files.workspace import remove_leftovers

SHARE = 0.05  # of the time that writing manifests may take; that of 10,000 shards has 3 MB


@dataclass(frozen=True)
class Task:
    """Files that one worker makes together: a shard, or a shard of questions and their answers.

    Attributes:
        names: of the files, without a folder.
        first, items: number of their first item, and how many they have.
    """

    names: tuple[str, ...]
    first: int
    items: int


T = TypeVar("T", bound=Task)


def complete_set(
    place: Path,
    asked: Manifest,
    tasks: Sequence[T],
    make: Callable[[Manifest, Sequence[T]], Generator[list[ShardRecord]]],
    join: Callable[[Manifest], None],
    *,
    overwrite: bool = False,
    confirm: Callable[[Sequence[T]], None] = lambda kept: None,
    progress: Callable[[int], Any] = lambda done: None,
) -> None:
    """Make the files of a set that earlier runs of the same request have not made.

    Files that are there are kept if their checksums are right. With `overwrite` they are not.

    Args:
        place: where the manifest is; the files lie beside it.
        asked: the manifest of the request, without shards.
        make: makes the files of tasks, and yields the records of each task when it is done. It gets
            the manifest of the run that began the set, whose command all files tell.
        join: writes the files that show shards as one.
        confirm: is called with the tasks whose files are kept, and raises SpecError where these
            answer another request in a way that the manifest does not tell.
        progress: is called with the number of rows that are there already.

    Raises SpecError where what is there answers another request, SceneGenError while another run
    makes this set, and OSError where something else has one of the names, or the disk refuses.
    """
    if is_remote(place):
        check_store(place)
    lock = place.with_name(f".{place.name}.lock")
    with nullcontext() if is_remote(place) else run_lock(lock, place):  # stores have no locks
        manifest = _begun(place, asked, tasks, overwrite)
        rows = {record.file: record.rows for record in manifest.shards}
        kept = [task for task in tasks if rows.keys() >= set(task.names)]
        confirm(kept)
        whole = all(place.with_name(name).exists() for name in asked.files)
        if manifest.complete and len(kept) == len(tasks) and whole:
            check_writable(place.with_name(asked.files[0]), overwrite=False)
        manifest = replace(manifest, complete=False)
        for task in kept:
            progress(rows[task.names[0]])
        records, due = list[ShardRecord](), 0.0
        write_manifest(place, manifest)
        missing = [task for task in tasks if not rows.keys() >= set(task.names)]
        try:
            with closing(make(manifest, missing)) as made:
                for some in made:
                    records += some
                    begun = time.monotonic()
                    if begun >= due:
                        write_manifest(place, manifest.with_shards(records))
                        due = time.monotonic() + (time.monotonic() - begun) / SHARE
        finally:
            manifest = manifest.with_shards(records)
            write_manifest(place, manifest)
        join(manifest)
        write_manifest(place, replace(manifest, complete=True))
        if not is_remote(place):
            remove_leftovers(place.parent)  # of workers that were killed


def check_shared(place: Path, asked: Manifest) -> None:
    """Raise SceneGenError on a worker that does not see the manifest of the set that it works on.

    Another folder may have the same name there, or another run may have begun meanwhile.
    """
    worker = f"the worker on {platform.node()}"
    if not place.exists():
        expected = "a folder that all workers see, or a URL such as s3://bucket/rooms.h5"
        raise SceneGenError(worker, f"no {place}", expected)
    differences = read_manifest(place).differences(asked)
    if differences:
        found = f"{place} of another run ({'; '.join(differences)})"
        raise SceneGenError(worker, found, "a folder that all workers share, and one run in it")


def remove_set(place: Path, file: str) -> None:
    """Remove what is left of the set that one whole file has just replaced."""
    place.unlink(missing_ok=True)
    for path in listing(place.parent):
        if set_name(path.name) == file:
            path.unlink(missing_ok=True)


def refuse_other_set(place: Path, files: Sequence[str]) -> None:
    """Raise SpecError where a manifest has the name of ours, but is that of other files."""
    if not place.exists():
        return
    with suppress(FileFormatError):  # a damaged one
        found = read_manifest(place)
        if set(found.files) != set(files):
            told, expected = ", ".join(found.files), f"that of {', '.join(files)}"
            raise SpecError(place, f"a manifest of {told}", expected, "choose another name")


def _begun(place: Path, asked: Manifest, tasks: Sequence[Task], overwrite: bool) -> Manifest:
    """Return the manifest of what is there already, without files that cannot be kept.

    Raises as `complete_set`.
    """
    names = {name for task in tasks for name in task.names}
    begun = place.exists()
    if overwrite and begun:
        refuse_other_set(place, asked.files)
    if overwrite or not begun:
        taken = [one for one in listing(place.parent) if one.name in names.union(asked.files)]
        for one in taken:
            check_writable(one, overwrite)
        if overwrite:
            _remove(place, asked)
        return asked
    found = read_manifest(place)
    differences = found.differences(asked)
    if differences:
        raise other_request(place, "; ".join(differences))
    records = [record for record in found.shards if record.file in names]

    def problem(record: ShardRecord) -> str | None:
        return shard_problem(place.parent, record)

    problems = list(in_threads(problem, records, processors(), 2 * processors()))
    kept = tuple(one for one, wrong in zip(records, problems, strict=True) if wrong is None)
    return replace(found, shards=kept)


def other_request(where: object, found: str) -> SpecError:
    """Return the error for files that answer another request."""
    hint = "repeat its options to go on, or start anew with --overwrite"
    return SpecError(where, found, "the same request as that of the run that began it", hint)


def _remove(place: Path, asked: Manifest) -> None:
    """Remove a set: the files that show it first, then its manifest, and its shards last."""
    for name in asked.files:
        place.with_name(name).unlink(missing_ok=True)
    place.unlink(missing_ok=True)
    for path in listing(place.parent):
        if set_name(path.name) in asked.files:
            path.unlink(missing_ok=True)


def record_file(file: Path, task: Task, rows: int, started: float) -> ShardRecord:
    """Return the record of a file that is complete; `started` is a time of `time.monotonic`."""
    with opened(file) as content:
        digest = str(content.attrs[CONTENT_DIGEST])
    seconds = round(time.monotonic() - started, 3)
    size, checksum = file.stat().st_size, file_sha256(file)
    return ShardRecord(file.name, task.first, task.items, rows, size, checksum, digest, seconds)
