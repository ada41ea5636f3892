"""Make the files of a set, and go on where an earlier run was killed.

Parts are made in a hidden folder beside the files: by this process, by worker processes, or by the
workers of a cluster. A complete part is there under its name and its SHA-256. A later run of the
same request keeps it if that is right. When all parts are there they get their names, and the files
that readers open get theirs last. A file holds the same bytes whoever makes it.
"""

import json
import platform
import re
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from contextlib import ExitStack, closing, contextmanager, nullcontext, suppress
from functools import partial
from pathlib import Path
from typing import Any, Protocol

from scenegen.common.cgroup import processors
from scenegen.common.errors import SceneGenError, SpecError
from scenegen.files.content import file_sha256
from scenegen.files.new_file import check_writable, write_text, written_beside
from scenegen.files.places import check_store, is_remote, listing, move, remove_folder, scratch
from scenegen.files.pool import LostWorkerError
from scenegen.files.sets.cluster import Cluster, threads_of_worker
from scenegen.files.sets.plan import Block, Piece, Plan
from scenegen.files.sets.sets import Packed, Progress, write_piece, write_views
from scenegen.files.sets.shards import name_of_set
from scenegen.files.sets.workers import in_order, in_threads
from scenegen.files.sets.workspace import run_lock, workspace

REQUEST = "request.json"  # what the parts answer
COMPLETE = "complete"  # is there when all parts are
PART = re.compile(r".+\.[0-9a-f]{16}", re.DOTALL)  # the name of a part, and of its SHA-256 so much
MOVED_AT_ONCE = 16  # files that a store renames, which copies them
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
    folder: Path,
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
    """Make the files of a set, of which earlier runs of the same request may have made parts.

    Args:
        folder: where the files are.
        shard_size: most items of one file; more go to shards.
        workers: processes of this machine that make rows.
        cluster: whose workers make whole pieces instead.
        overwrite: replace files of these names, and parts of another request.
        progress: is called with the number of rows that are there since the last call; first when
            nothing speaks against the request.

    Raises SpecError where the parts there answer another request, SceneGenError while another run
    makes this set, FileExistsError where files have these names, LostWorkerError where a block
    ended two processes, and OSError as the disk does.
    """
    pieces = [piece for bundle in plan.bundles for piece in bundle.pieces(shard_size)]
    names = {name for piece in pieces for name in piece.names}
    first = folder / plan.files[0]
    if is_remote(folder):
        check_store(first)
    elif cluster is not None:
        first = first.absolute()  # workers are in other folders
    home, request = parts_folder(first), plan.request(shard_size)
    if len(pieces) == 1 and cluster is None:  # after a kill there is nothing to go on with
        with suppress(OSError):  # a name that is too long
            check_request(home, request, overwrite)
        _check_free(folder, plan.files, overwrite)
        progress(0)
        with ExitStack() as naming:
            places = [folder / name for name in pieces[0].names]
            paths = [naming.enter_context(written_beside(place, overwrite)) for place in places]
            with _rows(pieces, work, workers, note) as rows:
                write_piece(paths, pieces[0], rows, plan.compression, progress)
        _remove_others(folder, plan.files, names)
        remove_folder(home)
        return
    lock = first.with_name(f".{first.name}.lock")
    with nullcontext() if is_remote(folder) else run_lock(lock, first):
        check_request(home, request, overwrite)
        if (home / COMPLETE).exists():
            progress(sum(piece.rows for piece in pieces))
        else:
            _check_free(folder, plan.files, overwrite)
            with _kept(home, request):
                parts = complete_parts(home, check=True)
                missing = [piece for piece in pieces if not parts.keys() >= set(piece.names)]
                progress(sum(piece.rows for piece in pieces if piece not in missing))
                if cluster is None:
                    with _rows(missing, work, workers, note) as rows:
                        for piece in missing:
                            _make_part(home, piece, rows, plan.compression, progress)
                else:
                    call = partial(_make_on_worker, home, request, missing, plan, work)
                    named, numbers = partial(_named, missing), range(len(missing))
                    made = cluster.results(call, numbers, named, in_order=False)
                    with closing(made):
                        for count, ends in made:
                            progress(count)
                            for end in ends:
                                note(end)
                write_views(home, complete_parts(home), pieces, plan)
                write_text(home / COMPLETE, "")
        _publish(home, folder, plan.files, names, overwrite)


def parts_folder(first: Path) -> Path:
    """Return the hidden folder with the parts of a set; `first` is the first file of its plan."""
    return first.with_name(f".{first.name}.parts")


def complete_parts(home: Path, check: bool = False) -> dict[str, Path]:
    """Return the parts that are complete, by the names of their files.

    Args:
        check: remove those whose SHA-256 is not that of their name.
    """
    paths = [path for path in listing(home) if PART.fullmatch(path.name)]
    if not check:
        return {path.stem: path for path in paths}
    count, parts = processors(), {}
    for path, digest in zip(paths, in_threads(file_sha256, paths, count, 2 * count), strict=True):
        if path.suffix == f".{digest[:16]}":
            parts[path.stem] = path
        else:
            path.unlink()
    return parts


@contextmanager
def _rows(pieces: Sequence[Piece], work: Work, workers: int, note: Note) -> Iterator[Iterator[Any]]:
    """Give the rows of pieces, from this process or from worker processes; all are to be taken."""
    blocks = (block for piece in pieces for block in piece.blocks if block.items)
    if workers > 1:
        blocks = (part for block in blocks for part in block.cut(work.block))
    with closing(
        in_order(partial(work.packed_rows, workers=workers), blocks, workers, note)
    ) as rows:
        yield rows
        next(rows, None)  # there are none; so worker processes end by themselves


def _make_part(
    home: Path,
    piece: Piece,
    rows: Iterator[Packed],
    compression: str,
    progress: Progress = lambda rows: None,
) -> None:
    """Make the files of a piece in the folder of parts. Errors of the disk name the set's file."""
    with workspace(scratch(home), home.with_name(piece.names[0])) as hidden:
        paths = [hidden / name for name in piece.names]
        write_piece(paths, piece, rows, compression, progress)
        for path in paths:
            move(path, home / f"{path.name}.{file_sha256(path)[:16]}")


def _make_on_worker(
    home: Path,
    request: Mapping[str, Any],
    pieces: Sequence[Piece],
    plan: Plan,
    work: Work,
    number: int,
) -> tuple[int, list[Any]]:
    """Make one of the pieces; to be called by a worker of a cluster."""
    check_shared(home, request)
    ends: list[Any] = []
    blocks = [block for block in pieces[number].blocks if block.items]
    make = partial(work.packed_rows, workers=max(1, processors() // threads_of_worker()))
    with closing(in_order(make, blocks, 1, ends.append)) as rows:
        _make_part(home, pieces[number], rows, plan.compression)
        next(rows, None)
    return pieces[number].rows, ends


def _named(pieces: Sequence[Piece], number: int) -> str:
    return ", ".join(str(block) for block in pieces[number].blocks if block.items)


def check_shared(home: Path, request: Mapping[str, Any]) -> None:
    """Raise SceneGenError on a worker that does not see the parts of the set that it works on.

    Another folder may have the same name there, or another run may have begun meanwhile.
    """
    worker, older = f"the worker on {platform.node()}", _read_request(home)
    if older is None:
        expected = "a folder that all workers see, or a URL such as s3://bucket/rooms.h5"
        raise SceneGenError(f"{worker} does not see {home}", expected=expected)
    if differences := _differences(older, request):
        where, expected = f"{worker} sees {home} of another run", "a folder that all workers share"
        raise SceneGenError(where, differences, f"{expected}, and one run in it")


def _read_request(home: Path) -> dict[str, Any] | None:
    """Return the request that parts answer; None where there is none."""
    try:
        request = json.loads((home / REQUEST).read_text(encoding="utf-8"))
    except (FileNotFoundError, NotADirectoryError, ValueError, RecursionError):
        return None
    return request if isinstance(request, dict) else None


def _differences(ours: Mapping[str, Any], theirs: Mapping[str, Any]) -> str:
    """Return what makes the bytes of another set other ones: `name here, not there`."""
    return "; ".join(
        f"{name} {ours.get(name)}, not {theirs.get(name)}"
        for name in sorted(ours.keys() | theirs.keys())
        if ours.get(name) != theirs.get(name)
    )


def check_request(home: Path, request: Mapping[str, Any], overwrite: bool) -> bool:
    """Return whether parts of this request are there; remove what is of no request.

    Raises SpecError where parts answer another request; with `overwrite` these are removed.
    """
    older = _read_request(home)
    differences = "" if older is None else _differences(older, request)
    if differences and not overwrite:
        where, expected = f"{home} has parts of another request", "the same options"
        hint = "repeat its options to go on, or start anew with --overwrite"
        raise SpecError(where, differences, expected, hint)
    if older is None or differences:
        remove_folder(home)
    return older is not None and not differences


def write_request(home: Path, request: Mapping[str, Any]) -> None:
    """Make a folder of parts for a request, if it is not there."""
    if not is_remote(home):
        home.mkdir(exist_ok=True)
    with written_beside(home / REQUEST, overwrite=True) as path:
        path.write_text(json.dumps(request, indent=1), encoding="utf-8")


def _check_free(folder: Path, names: Sequence[str], overwrite: bool) -> None:
    """Raise FileExistsError where files have the names of a set or of its shards."""
    for path in _files(folder, names):
        check_writable(path, overwrite)


@contextmanager
def _kept(home: Path, request: Mapping[str, Any]) -> Iterator[None]:
    """Make the folder of parts for the block; where that raises, it goes unless it has some."""
    try:
        write_request(home, request)
        yield
    except LostWorkerError as error:
        kept = f"{len(complete_parts(home))} complete files are kept; the same command goes on"
        hint = "; ".join(filter(None, (error.hint, kept)))
        raise LostWorkerError(error.where, error.found, "", hint) from error
    finally:
        if not complete_parts(home):
            remove_folder(home)


def _publish(
    home: Path, folder: Path, files: Sequence[str], names: set[str], overwrite: bool
) -> None:
    """Give all parts their names, those that readers open last; a run that was killed goes on."""
    parts = complete_parts(home)
    parts |= {path.name: path for path in listing(home) if path.name in files}
    for path in _files(folder, files):
        if path.name in parts:
            check_writable(path, overwrite)
    for name in files:
        if name in parts:
            (folder / name).unlink(missing_ok=True)
    _remove_others(folder, files, names)
    for chosen in (parts.keys() - set(files), sorted(parts.keys() & set(files))):
        moved = in_threads(
            lambda name: move(parts[name], folder / name), chosen, MOVED_AT_ONCE, MOVED_AT_ONCE
        )
        list(moved)
    (home / REQUEST).unlink(missing_ok=True)  # without it the rest goes, whatever happens now
    remove_folder(home)


def _remove_others(folder: Path, files: Sequence[str], names: set[str]) -> None:
    """Remove what an older set has more: files of other names, or more shards."""
    for path in _files(folder, files):
        if path.name not in names and path.name not in files:
            path.unlink(missing_ok=True)


def _files(folder: Path, names: Sequence[str]) -> list[Path]:
    """Return which files of these names are in a folder, and which shards of theirs."""
    return [path for path in listing(folder) if {path.name, name_of_set(path.name)} & set(names)]
