"""Hidden folders in which files are made before they get their names, each of one run alone.

A workspace has a random name, is made exclusively, and holds a file that its run keeps locked for
as long as it lives. So no two runs share one, in whatever containers or threads they are, and one
whose lock is free was left by a run that was killed. Where a disk has no locks, none is removed.
"""

import errno
import functools
import hashlib
import os
import platform
import re
import secrets
import shutil
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from scenegen.common.signals import held_back

try:
    import fcntl
except ImportError:  # Windows: nothing is locked there, and nothing that is left is removed
    fcntl = None  # type: ignore[assignment]

NAME = re.compile(r"\.pix2shape-bench-[0-9a-f]{8}-[0-9a-f]{16}\.partial")
LOCK = "lock"
# What a disk may say when it is written to; other errors without a path are not about the output.
DISK_ERRORS = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EROFS)


@contextmanager
def workspace(parent: Path, path: Path) -> Iterator[Path]:
    """Make a workspace in a folder; it is removed, with all it holds, when the block ends.

    What killed runs left in the folder is removed when a process first comes to it. Signals wait
    while the workspace is made, and while it is removed. Errors of the disk that concern the
    workspace's first file or folder are raised as OSErrors about `path`.
    """
    try:
        _first_look(parent.absolute())
        made: list[tuple[Path, int]] = []
        try:
            try:
                with held_back():
                    made.append(_made(parent))
                yield made[0][0]
            finally:
                _remove_made(made)
        finally:  # again, as a signal may come just before that holds signals back
            _remove_made(made)
    except BrokenPipeError:  # of a terminal
        raise
    except (OSError, RuntimeError) as error:
        named = error.filename if isinstance(error, OSError) else None
        inside = () if named is None else _hidden_parts(named, parent)
        number = None if inside is None else _disk_errno(error)
        if inside is None or number is None or (named is None and number not in DISK_ERRORS):
            raise
        where = str(path.joinpath(*inside))
        raise OSError(number, f"cannot be written: {os.strerror(number)}", where) from error


def _remove_made(made: list[tuple[Path, int]]) -> None:
    """Remove workspaces of this run, each with the descriptor of its lock, and forget them."""
    with held_back():
        while made:
            folder, lock = made.pop()
            _empty(folder)
            os.close(lock)
            _remove(folder)


def remove_leftovers(parent: Path) -> None:
    """Remove from a folder the workspaces of runs that were killed, and warn, naming each.

    Locks may not reach from one machine to another. So those of other machines, and those from
    before the last start of this one, are only named.
    """
    try:
        names = [name for name in os.listdir(parent) if NAME.fullmatch(name)]
    except OSError:
        return
    for folder in (parent / name for name in names):
        told = None
        with suppress(OSError):
            told = _clean(folder)
        if told:
            warnings.warn(told, stacklevel=2)


_first_look = functools.cache(remove_leftovers)  # folders may hold a million files


def _hidden_parts(path: object, parent: Path) -> tuple[str, ...] | None:
    """Return the parts of a path below the first file or folder of a workspace in `parent`."""
    try:
        parts = Path(os.fsdecode(path)).relative_to(parent).parts  # type: ignore[arg-type]
    except (ValueError, TypeError):
        return None
    return parts[2:] if parts and NAME.fullmatch(parts[0]) else None


def _disk_errno(error: Exception) -> int | None:
    """Return the system's number of an error; HDF5 and OpenEXR tell only what the system said."""
    if isinstance(error, OSError) and error.errno:
        return error.errno
    said = [number for number in errno.errorcode if os.strerror(number) in str(error)]
    return max(said, key=lambda number: len(os.strerror(number)), default=None)


@functools.cache
def _prefix() -> str:
    """Return how names begin on this machine, on Linux since it was started."""
    try:
        about = Path("/proc/sys/kernel/random/boot_id").read_text()
    except OSError:
        about = platform.node()
    return f".pix2shape-bench-{hashlib.sha256(about.encode()).hexdigest()[:8]}-"


def _made(parent: Path) -> tuple[Path, int]:
    """Make a workspace; return it and the descriptor of its lock, which holds until it is closed.

    Another run may take it for a leftover before it is locked; then a new one is made.
    """
    while True:
        folder = parent / f"{_prefix()}{secrets.token_hex(8)}.partial"
        try:
            folder.mkdir()
        except FileExistsError:
            continue
        try:
            lock = _locked(folder, os.O_CREAT | os.O_EXCL)
        except OSError:
            _remove(folder)
            raise
        if lock is not None:
            return folder, lock


def _locked(folder: Path, flags: int = 0) -> int | None:
    """Lock a workspace; return the descriptor, None where another run has it or removed it.

    Where there are no locks, the flags to make a new file decide whether it counts as locked.
    """
    path = folder / LOCK
    try:
        lock = os.open(path, os.O_RDWR | getattr(os, "O_NOFOLLOW", 0) | flags, 0o666)
    except FileNotFoundError:
        return None
    try:
        if fcntl is None:
            raise OSError(errno.ENOTSUP, os.strerror(errno.ENOTSUP))
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        ours = os.path.samestat(os.fstat(lock), path.lstat())
    except (BlockingIOError, FileNotFoundError):
        ours = False
    except OSError:
        ours = bool(flags)
    if not ours:
        os.close(lock)
    return lock if ours else None


def _clean(folder: Path) -> str | None:
    """Remove a workspace that a killed run left; return what is to be said about it, if anything.

    Raises OSError where it cannot be looked at or removed, or is somebody's.
    """
    lock = _locked(folder)
    if lock is None:
        folder.rmdir()  # fails unless its run was killed before it locked it
        return None
    try:
        files = [path for path in folder.rglob("*") if path.name != LOCK and not path.is_dir()]
        size = f"({sum(path.lstat().st_size for path in files) / 1e6:.1f} MB)"
        if not folder.name.startswith(_prefix()):
            text = "seems to be left by a run on another machine, or from before a restart"
            return f"{folder}: {text} {size}; remove it if no run writes there"
        _empty(folder)
        (folder / LOCK).unlink()  # before it is let go: its maker may be about to lock it
    finally:
        os.close(lock)
    folder.rmdir()
    return f"removed what an earlier run left unfinished: {folder} {size}" if files else None


def _empty(folder: Path) -> None:
    """Remove all but the lock from a workspace whose lock is held."""
    with suppress(OSError):
        for path in list(folder.iterdir()):
            if path.is_dir() and not path.is_symlink():
                shutil.rmtree(path, ignore_errors=True)
            elif path.name != LOCK:
                path.unlink(missing_ok=True)


def _remove(folder: Path) -> None:
    """Remove a workspace that is empty but for its lock."""
    with suppress(OSError):
        if os.listdir(folder) == [LOCK]:
            (folder / LOCK).unlink()
        folder.rmdir()
