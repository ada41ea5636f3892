"""Make the files of a set, and go on where an earlier run was killed.

Each piece is made by one call, here or on a worker of a cluster. A file gets its name when it is
complete, and holds the same bytes whoever makes it. A file that was completed but is not in the
manifest, because the run was killed right then, is made again.
"""

import platform
import time
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import closing, contextmanager, nullcontext, suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, Protocol

from scenegen.common.cgroup import processors
from scenegen.common.errors import FileFormatError, SceneGenError, SpecError
from scenegen.files.new_file import check_writable
from scenegen.files.places import check_store, is_remote, listing
from scenegen.files.pool import LostWorkerError
from scenegen.files.sets.cluster import Cluster, threads_of_worker
from scenegen.files.sets.manifest import (
    FileRecord,
    Manifest,
    read_manifest,
    write_manifest,
    wrong_files,
)
from scenegen.files.sets.plan import Block, Piece, Plan
from scenegen.files.sets.sets import Packed, Progress, write_piece, write_views
from scenegen.files.sets.shards import name_of_set
from scenegen.files.sets.workers import in_order
from scenegen.files.sets.workspace import remove_leftovers, run_lock

SHARE = 0.05  # of the time that writing manifests may take; that of 10,000 shards has 3 MB
Note = Callable[[Any], Any]


class Work(Protocol):
    """What a task does for a set. It is pickled, so that any process can do it."""

    @property
    def block(self) -> int:
        """Items that a worker process makes in one go."""

    def packed_rows(self, block: Block, workers: int) -> Generator[Packed, None, Any]:
        """Make the rows of a block, on one of `workers` equal shares of this machine.

        What it returns at the end goes to `note` of `make_set`.
        """


def make_set(
    place: Path,
    plan: Plan,
    work: Work,
    shard_size: int,
    *,
    workers: int = 1,
    cluster: Cluster | None = None,
    overwrite: bool = False,
    progress: Progress = lambda rows: None,
    note: Note = lambda end: None,
) -> None:
    """Make the files of a set that earlier runs of the same request have not made.

    Files that the manifest lists are kept if their checksums are right; with `overwrite` they are
    not. A set of one whole file has no manifest when it is complete.

    Args:
        place: where the manifest is; the files lie beside it.
        shard_size: most items of one file; more go to shards.
        workers: processes of this machine that make rows.
        cluster: whose workers make whole pieces instead.
        progress: is called with the number of rows that are there since the last call; first when
            nothing speaks against the request.

    Raises SpecError where the files there answer another request, SceneGenError while another run
    makes this set, FileExistsError where all files are there or others have their names, and
    OSError as the disk does.
    """
    pieces = [piece for bundle in plan.bundles for piece in bundle.pieces(shard_size)]
    request = plan.manifest(shard_size)
    if is_remote(place):
        check_store(place)
    elif cluster is not None:
        place = place.absolute()  # workers are in other folders
    if len(pieces) == 1 and cluster is None:  # after a kill there is nothing to go on with
        _completed_files(place, request, pieces, overwrite)
        progress(0)
        list(_made_here(place.parent, pieces, plan, work, workers, overwrite, progress, note))
        _remove(place, request.files if overwrite else (), keep=pieces[0].names)
        return
    lock = place.with_name(f".{place.name}.lock")
    with nullcontext() if is_remote(place) else run_lock(lock, place):
        ledger = _Ledger(place, request, _completed_files(place, request, pieces, overwrite))
        missing = [piece for piece in pieces if not ledger.has(piece)]
        if overwrite:
            _remove(place, request.files)
        if cluster is None:
            made = _made_here(place.parent, missing, plan, work, workers, True, progress, note)
        else:
            call = partial(_made_on_worker, place, request, missing, plan, work)
            named = partial(_named, missing)
            results = cluster.results(call, range(len(missing)), named, in_order=False)
            made = _noted(results, progress, note)
        try:
            with ledger.kept(), closing(made):
                progress(sum(ledger.rows(piece) for piece in pieces))
                for records in made:
                    ledger.add(records)
        except LostWorkerError as error:
            kept = f"{len(ledger.records)} complete files are kept; the same command goes on"
            hint = "; ".join(filter(None, (error.hint, kept)))
            raise LostWorkerError(error.where, error.found, "", hint) from error
        for bundle in plan.bundles:
            shards = [piece for piece in pieces if piece.is_shard and piece.bundle is bundle]
            if shards:
                write_views(place.parent, shards, ledger.records, plan.compression)
        ledger.save(complete=True)
        if len(pieces) == 1:
            place.unlink()
        if not is_remote(place):
            remove_leftovers(place.parent)  # of workers that were killed


class _Ledger:
    """The manifest of a run, which is written as files are completed.

    Attributes:
        records: of the complete files, by name.
    """

    def __init__(self, place: Path, request: Manifest, records: Sequence[FileRecord]) -> None:
        self._place, self._request, self._due = place, request, 0.0
        self.records = {record.file: record for record in records}

    def has(self, piece: Piece) -> bool:
        """Return whether all files of a piece are complete."""
        return self.records.keys() >= set(piece.names)

    def rows(self, piece: Piece) -> int:
        """Return the number of rows of a piece that is complete, else 0."""
        return self.records[piece.names[0]].rows if self.has(piece) else 0

    def add(self, records: Sequence[FileRecord]) -> None:
        """Take the records of files that are complete now."""
        self.records.update({record.file: record for record in records})
        begun = time.monotonic()
        if begun >= self._due:
            self.save()
            self._due = time.monotonic() + (time.monotonic() - begun) / SHARE

    def save(self, complete: bool = False) -> None:
        """Write the manifest."""
        shards = tuple(self.records[name] for name in sorted(self.records))
        write_manifest(self._place, replace(self._request, complete=complete, shards=shards))

    @contextmanager
    def kept(self) -> Iterator[None]:
        """Write the manifest, and again at the end of the block; it goes if no file is complete.

        A file may have got its name just before its record is added.
        """
        self.save()
        try:
            yield
        finally:
            if self.records or _files(self._place.parent, self._request.files):
                self.save()
            else:
                self._place.unlink(missing_ok=True)


def _made_here(
    folder: Path,
    pieces: Sequence[Piece],
    plan: Plan,
    work: Work,
    workers: int,
    overwrite: bool,
    progress: Progress,
    note: Note,
) -> Generator[list[FileRecord]]:
    """Make pieces one after the other, with rows from this process or from worker processes."""
    blocks = (block for piece in pieces for block in piece.blocks if block.items)
    if workers > 1:
        blocks = (part for block in blocks for part in block.cut(work.block))
    make = partial(work.packed_rows, workers=workers)
    with closing(in_order(make, blocks, workers, note)) as rows:
        for piece in pieces:
            yield write_piece(folder, piece, rows, plan.compression, overwrite, progress)
        next(rows, None)  # there are none; so worker processes end by themselves


def _made_on_worker(
    place: Path, request: Manifest, pieces: Sequence[Piece], plan: Plan, work: Work, number: int
) -> tuple[list[FileRecord], list[Any]]:
    """Make one of the pieces; to be called by a worker of a cluster."""
    check_shared(place, request)
    ends: list[Any] = []
    share = max(1, processors() // threads_of_worker())
    blocks = [block for block in pieces[number].blocks if block.items]
    with closing(
        in_order(partial(work.packed_rows, workers=share), blocks, 1, ends.append)
    ) as rows:
        records = write_piece(place.parent, pieces[number], rows, plan.compression)
        next(rows, None)
    return records, ends


def _named(pieces: Sequence[Piece], number: int) -> str:
    return ", ".join(str(block) for block in pieces[number].blocks if block.items)


def _noted(
    made: Generator[tuple[list[FileRecord], list[Any]]], progress: Progress, note: Note
) -> Generator[list[FileRecord]]:
    with closing(made):
        for records, ends in made:
            for end in ends:
                note(end)
            progress(records[0].rows)
            yield records


def check_shared(place: Path, request: Manifest) -> None:
    """Raise SceneGenError on a worker that does not see the manifest of the set that it works on.

    Another folder may have the same name there, or another run may have begun meanwhile.
    """
    worker = f"the worker on {platform.node()}"
    if not place.exists():
        expected = "a folder that all workers see, or a URL such as s3://bucket/rooms.h5"
        raise SceneGenError(f"{worker} does not see {place}", expected=expected)
    differences = read_manifest(place).differences(request)
    if differences:
        where = f"{worker} sees {place} of another run"
        expected = "a folder that all workers share, and one run in it"
        raise SceneGenError(where, "; ".join(differences), expected)


def _completed_files(
    place: Path, request: Manifest, pieces: Sequence[Piece], overwrite: bool
) -> list[FileRecord]:
    """Return the records of files that earlier runs of the request completed, and that are right.

    Raises as `make_set`.
    """
    names = {name for piece in pieces for name in piece.names}
    older = _older(place, request, overwrite)
    differences = older.differences(request) if older else []
    if older and not overwrite and not differences:
        records = [record for record in older.shards if record.file in names]
        wrong = wrong_files(place.parent, records)
        whole = older.complete and not wrong and len(records) == len(names)
        if whole and all(place.with_name(name).exists() for name in request.files):
            check_writable(place.with_name(request.files[0]), overwrite=False)
        return [record for record in records if record.file not in wrong]
    if older and not overwrite and older.shards:
        hint = "repeat its options to go on, or start anew with --overwrite"
        where, expected = f"{place} is of another request", "the same options"
        raise SpecError(where, "; ".join(differences), expected, hint)
    for path in _files(place.parent, request.files):
        check_writable(path, overwrite)
    return []


def _older(place: Path, request: Manifest, overwrite: bool) -> Manifest | None:
    """Return the manifest that is there, if any.

    Raises SpecError where it is that of other files, and FileFormatError unless it is replaced.
    """
    try:
        if not place.exists():
            return None
    except OSError:  # the name is too long; then there is no manifest
        return None
    try:
        older = read_manifest(place)
    except FileFormatError:
        if overwrite:
            return None
        raise
    if set(older.files) != set(request.files):
        where = f"{place} is the manifest of {', '.join(older.files)}"
        raise SpecError(where, hint=f"choose another name than {request.files[0]}")
    return older


def _remove(place: Path, files: Sequence[str], keep: Sequence[str] = ()) -> None:
    """Remove a set: the files that show it first, then its manifest, and its shards last."""
    for name in set(files).difference(keep):
        place.with_name(name).unlink(missing_ok=True)
    with suppress(OSError):  # a name that is too long
        place.unlink(missing_ok=True)
    for path in _files(place.parent, files) if files else ():
        if path.name not in keep:
            path.unlink(missing_ok=True)


def _files(folder: Path, names: Sequence[str]) -> list[Path]:
    """Return which files of these names are in a folder, and which shards of theirs."""
    return [path for path in listing(folder) if {path.name, name_of_set(path.name)} & set(names)]
