"""Make the files of a set, and go on where an earlier run was killed.

Parts are made in a hidden folder beside the files: by this process, by worker processes, or by the
workers of a cluster. A complete part is there under its name and its SHA-256. A later run of the
same request keeps it if that is right. When all parts are there they get their names, and the files
that readers open get theirs last. A file holds the same bytes whoever makes it.
"""

import errno
import json
import platform
import re
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager, nullcontext
from functools import partial
from pathlib import Path, PurePosixPath
from typing import Any, Protocol

from scenegen.common.cgroup import processors
from scenegen.common.errors import SceneGenError, SpecError
from scenegen.files.content import file_sha256
from scenegen.files.input_file import HDF5_ERRORS
from scenegen.files.new_file import check_writable, write_text
from scenegen.files.places import check_store, is_remote, listing, move, remove_folder, scratch
from scenegen.files.pool import LostWorkerError
from scenegen.files.sets.cluster import Cluster, threads_of_worker
from scenegen.files.sets.plan import Block, Piece
from scenegen.files.sets.sets import Packed, Progress, write_piece, write_view
from scenegen.files.sets.shards import name_of_set, opened
from scenegen.files.sets.workers import in_order, in_threads
from scenegen.files.sets.workspace import run_lock, workspace

REQUEST = "request.json"  # what the parts answer
COMPLETE = "complete"  # is there when all parts are
PART = re.compile(r".+\.[0-9a-f]{16}", re.DOTALL)  # the name of a part, and of its SHA-256 so much
IN_FOLDER = "%2F"  # stands for "/" there
MOVED_AT_ONCE = 16  # files that a store renames, which copies them
Note = Callable[[Any], Any]


class CompleteError(FileExistsError):
    """The files of a request are there: an earlier run of the same request made them."""


class Work(Protocol):
    """What a task does for a set. It is pickled, so that any process can do it."""

    @property
    def compression(self) -> str:
        """As in `table.COMPRESSIONS`."""

    @property
    def block(self) -> int:
        """Items that a worker process makes in one go."""

    def packed_rows(self, block: Block, workers: int) -> Generator[Packed, None, Any]:
        """Make the rows of a block, on one of `workers` equal shares of this machine.

        What it returns at the end goes to `note` of `make_set`.
        """


def make_set(
    folder: Path,
    wholes: Sequence[Piece],
    request: Mapping[str, Any],
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
        folder: where the files are; their names may begin with a folder in it, which is made.
        wholes: the files that readers open.
        request: what their bytes depend on, but for `work.compression` and sizes.
        shard_size: most items of one file; more go to shards.
        workers: processes of this machine that make rows.
        cluster: whose workers make whole pieces instead.
        overwrite: replace files of these names, and parts of another request.
        progress: is called with the number of rows that are there since the last call; first when
            nothing speaks against the request.

    Raises SpecError where parts there answer another request, SceneGenError while another run makes
    this set, CompleteError where files of the same request are there, FileExistsError where other
    files have these names, LostWorkerError where a block ended two
    processes, and OSError as the disk does.
    """
    cuts = [whole.cut(shard_size) for whole in wholes]
    pieces = [piece for cut in cuts for piece in cut]
    files = [name for whole in wholes for name in whole.files]
    request = {
        **request, "files": ", ".join(files), "compression": work.compression,
        "n": sum(len(block.items) for whole in wholes for block in whole.blocks),
        "shard-size": shard_size,
    }  # fmt: skip
    first = folder / PurePosixPath(files[0]).name
    if is_remote(folder):
        check_store(first)
    elif cluster is not None:
        folder, first = folder.absolute(), first.absolute()  # workers are in other folders
    home, lock = parts_folder(first), first.with_name(f".{first.name}.lock")
    with nullcontext() if is_remote(folder) else run_lock(lock, first):
        _take_over(home, request, overwrite)
        if (home / COMPLETE).exists():
            progress(sum(piece.rows for piece in pieces))
        else:
            there = _there(folder, files)
            if there and not overwrite and _is_complete(folder, wholes, request):
                text = "complete. The same command has made it before; --overwrite makes it again"
                raise CompleteError(errno.EEXIST, text, str(first))
            for path in there.values():
                check_writable(path, overwrite)
            with _kept(home, request):
                parts = complete_parts(home, check=True)
                missing = [piece for piece in pieces if not parts.keys() >= piece.files.keys()]
                progress(sum(piece.rows for piece in pieces if piece not in missing))
                if cluster is None:
                    _make_parts(home, missing, work, workers, workers, progress, note)
                else:
                    _make_on_cluster(home, request, missing, work, cluster, progress, note)
                parts = complete_parts(home)
                for whole, cut in zip(wholes, cuts, strict=True):
                    if cut[0].is_shard:
                        with _part(home, whole) as paths:
                            write_view(paths, whole, cut, parts, work.compression)
                write_text(home / COMPLETE, "")
        _publish(home, folder, files, {name for piece in pieces for name in piece.files}, overwrite)


def _is_complete(folder: Path, wholes: Sequence[Piece], request: Mapping[str, Any]) -> bool:
    """Return whether the files of a request are there, by their attributes and numbers of rows.

    Files with a secret seed do not tell which seed made them.
    """
    if is_remote(folder) or request.get("secret-seed") == "yes":
        return False
    for whole in wholes:
        sheets = [(block.rows, sheet) for block in whole.blocks for sheet in block.part.sheets]
        for number, (name, attributes) in enumerate(whole.files.items()):
            rows = {path: n for n, sheet in sheets if sheet.file == number for path in sheet.paths}
            try:
                with opened(folder / name) as file:
                    same = all(file.attrs[key] == value for key, value in attributes.items())
                    if not same or any(len(file[path]) != n for path, n in rows.items()):
                        return False
            except HDF5_ERRORS:
                return False
    return True


def parts_folder(first: Path) -> Path:
    """Return the hidden folder with the parts of a set; `first` is the first of its files."""
    return first.with_name(f".{first.name}.parts")


def complete_parts(home: Path, check: bool = False) -> dict[str, Path]:
    """Return the parts that are complete, by the names of their files.

    Args:
        check: remove those whose SHA-256 is not that of their name.
    """
    paths = [path for path in listing(home) if PART.fullmatch(path.name)]
    if check:
        count, right = processors(), []
        digests = in_threads(file_sha256, paths, count, 2 * count)
        for path, digest in zip(paths, digests, strict=True):
            if path.suffix == f".{digest[:16]}":
                right.append(path)
            else:
                path.unlink()
        paths = right
    return {path.stem.replace(IN_FOLDER, "/"): path for path in paths}


def _make_parts(
    home: Path,
    pieces: Sequence[Piece],
    work: Work,
    workers: int,
    shares: int,
    progress: Progress,
    note: Note,
) -> None:
    """Make the files of pieces in the folder of parts, here or with worker processes.

    Args:
        shares: of this machine, of which each process has one.
    """
    blocks = (block for piece in pieces for block in piece.blocks if block.items)
    if workers > 1:
        blocks = (part for block in blocks for part in block.cut(work.block))
    make = partial(work.packed_rows, workers=shares)
    with closing(in_order(make, blocks, workers, note)) as rows:
        for piece in pieces:
            with _part(home, piece) as paths:
                write_piece(paths, piece, rows, work.compression, progress)
        next(rows, None)  # there are none; so worker processes end by themselves


@contextmanager
def _part(home: Path, piece: Piece) -> Iterator[list[Path]]:
    """Give hidden paths for the files of a piece; they are parts when the block ends well.

    They are beside the folder of parts, where the next run looks for what a killed one left. Errors
    of the disk name the set's file.
    """
    folder = home.parent
    with workspace(scratch(folder), folder / next(iter(piece.files))) as hidden:
        paths = [hidden / name.replace("/", IN_FOLDER) for name in piece.files]
        yield paths
        for path in paths:
            move(path, home / f"{path.name}.{file_sha256(path)[:16]}")


def _make_on_cluster(
    home: Path,
    request: Mapping[str, Any],
    pieces: Sequence[Piece],
    work: Work,
    cluster: Cluster,
    progress: Progress,
    note: Note,
) -> None:
    """Make the files of pieces in the folder of parts, each piece on one worker."""
    call, numbers = partial(_make_on_worker, home, request, pieces, work), range(len(pieces))
    with closing(cluster.results(call, numbers, partial(_named, pieces), in_order=False)) as made:
        for count, ends in made:
            progress(count)
            for end in ends:
                note(end)


def _make_on_worker(
    home: Path, request: Mapping[str, Any], pieces: Sequence[Piece], work: Work, number: int
) -> tuple[int, list[Any]]:
    check_shared(home, request)
    shares, ends = max(1, processors() // threads_of_worker()), list[Any]()
    _make_parts(home, [pieces[number]], work, 1, shares, lambda rows: None, ends.append)
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


def _take_over(home: Path, request: Mapping[str, Any], overwrite: bool) -> None:
    """Remove what earlier runs left, unless it is of this request.

    Raises SpecError where parts answer another request, without `overwrite`.
    """
    older = _read_request(home)
    differences = "" if older is None else _differences(older, request)
    if differences and not overwrite and complete_parts(home):
        where, expected = f"{home} has parts of another request", "the same options"
        hint = "use the same options to resume, or start again with --overwrite"
        raise SpecError(where, differences, expected, hint)
    if older is None or differences:
        remove_folder(home)


@contextmanager
def _kept(home: Path, request: Mapping[str, Any]) -> Iterator[None]:
    """Make the folder of parts for the block; where that raises, it goes unless it has some."""
    try:
        if not is_remote(home):
            home.mkdir(exist_ok=True)
        write_text(home / REQUEST, json.dumps(request, indent=1), overwrite=True)
        yield
    except LostWorkerError as error:
        kept = f"{len(complete_parts(home))} files are kept; re-run the same command to resume"
        hint = "; ".join(filter(None, (error.hint, kept)))
        raise LostWorkerError(error.where, error.found, "", hint) from error
    finally:
        if not complete_parts(home):
            remove_folder(home)


def _publish(
    home: Path, folder: Path, files: Sequence[str], names: set[str], overwrite: bool
) -> None:
    """Give all parts their names, those that readers open last; a run that was killed goes on.

    One file takes the place of an older one at once. Of several, all older ones go before.
    """
    parts, there = complete_parts(home), _there(folder, files)
    for name in there.keys() & parts.keys():
        check_writable(there[name], overwrite)
    for name, path in there.items():
        if name not in {*names, *files} or (name in files and name in parts and len(parts) > 1):
            path.unlink(missing_ok=True)
    for chosen in (parts.keys() - set(files), sorted(parts.keys() & set(files))):
        for name in chosen if not is_remote(folder) else ():
            (folder / name).parent.mkdir(exist_ok=True)
        moved = in_threads(
            lambda name: move(parts[name], folder / name), chosen, MOVED_AT_ONCE, MOVED_AT_ONCE
        )
        list(moved)
    (home / REQUEST).unlink(missing_ok=True)  # without it the rest goes, whatever happens now
    remove_folder(home)


def _there(folder: Path, files: Sequence[str]) -> dict[str, Path]:
    """Return which of these files there are, and which shards of them, by name."""
    there = {}
    for parent in {PurePosixPath(name).parent for name in files}:
        for path in listing(folder.joinpath(*parent.parts)):
            name = (parent / path.name).as_posix()
            if not {name, name_of_set(name)}.isdisjoint(files):
                there[name] = path
    return there
