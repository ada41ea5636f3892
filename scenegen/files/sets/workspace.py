"""Hidden folders in which outputs are made before they get their names, and locks of runs.

A process holds a lock on each of its workspaces for as long as it lives. A workspace without a lock
was left by a run that was killed: the next run in the same folder removes it.
"""

import errno
import functools
import hashlib
import itertools
import os
import platform
import re
import secrets
import shutil
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from scenegen.common.errors import SceneGenError
from scenegen.common.signals import held_back

try:
    import fcntl
except ImportError:  # Windows has no such locks: what killed runs leave there stays
    fcntl = None  # type: ignore[assignment]

NAME = re.compile(r"\.pix2shape-bench-[0-9a-f]{8}-[0-9a-f]{16}\.partial")
# What a disk may say when it is written to. HDF5 and OpenEXR raise errors that only quote it.
DISK_ERRORS = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EROFS)
TRIES = 100  # to make a workspace that no other run takes for a leftover
_held: set[str] = set()  # run locks of this process, which the system would let it take twice
_Workspace = tuple[Path, int | None]  # a folder, and the descriptor that holds its lock


@contextmanager
def workspace(parent: Path, path: Path) -> Iterator[Path]:
    """Make a hidden folder in `parent`; remove it, with all it holds, when the block ends.

    What killed runs left in `parent` is removed when a process first comes to it. An error of the
    disk is raised as an OSError about `path`, the output that is made in the workspace.
    """
    _first_look(parent.absolute())
    made: list[_Workspace] = []
    try:
        try:
            with held_back():
                made.append(_made(parent))
            yield made[0][0]
        except BrokenPipeError:  # of a terminal
            raise
        except (OSError, RuntimeError) as error:
            about_path = _about(error, parent, path)
            if about_path is None:
                raise
            raise about_path from error
        finally:
            _remove(made)
    finally:  # again: a signal may come just before `_remove` holds signals back
        _remove(made)


def remove_leftovers(parent: Path) -> None:
    """Remove the workspaces that killed runs left in a folder, and warn, naming each.

    Locks may not reach from one machine to another. A workspace of another machine, or from before
    the last start of this one, is only named.
    """
    names: list[str] = []
    with suppress(OSError):
        names = [name for name in os.listdir(parent) if NAME.fullmatch(name)]
    for folder in (parent / name for name in names):
        with suppress(OSError):  # its run lives, or it cannot be looked at or removed
            _remove_leftover(folder)


_first_look = functools.cache(remove_leftovers)  # a folder may hold a million files


def _remove_leftover(folder: Path) -> None:
    lock = _locked(folder)
    if lock is None:
        return
    try:
        files = [path for path in folder.rglob("*") if not path.is_dir()]
        size = f"({sum(path.lstat().st_size for path in files) / 1e6:.1f} MB)"
        if not folder.name.startswith(_prefix()):
            text = "a run on another machine, or before a restart, probably left it"
            warnings.warn(
                f"{folder}: {text} {size}; remove it if no run writes there", stacklevel=2
            )
            return
        shutil.rmtree(folder)
        if files:
            warnings.warn(
                f"removed files of an earlier, interrupted run: {folder} {size}", stacklevel=2
            )
    finally:
        os.close(lock)


def _made(parent: Path) -> _Workspace:
    """Make a workspace. Another run may take it for a leftover, or remove it, before it is locked.

    Then a new one is made. Some disks, such as /proc, always refuse as if it had been removed.
    """
    tries = itertools.count(1)
    while True:
        folder = parent / f"{_prefix()}{secrets.token_hex(8)}.partial"
        try:
            folder.mkdir()
            return folder, _locked(folder)
        except (FileExistsError, BlockingIOError, FileNotFoundError):
            if next(tries) == TRIES:
                raise


def _locked(folder: Path) -> int | None:
    """Lock a workspace; return the descriptor that holds the lock, None on a disk without locks.

    Raises BlockingIOError where another process has the lock, and OSError where the folder is gone.
    """
    if fcntl is None:
        return None
    lock = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        folder.lstat()  # another run may have removed it just before
    except OSError as error:
        os.close(lock)
        if isinstance(error, (BlockingIOError, FileNotFoundError)):
            raise
        return None
    return lock


def _remove(made: list[_Workspace]) -> None:
    """Remove workspaces of this process, and forget them."""
    with held_back():
        while made:
            folder, lock = made.pop()
            shutil.rmtree(folder, ignore_errors=True)
            if lock is not None:
                os.close(lock)


@functools.cache
def _prefix() -> str:
    """Return how names begin on this machine, on Linux since it was started."""
    try:
        about = Path("/proc/sys/kernel/random/boot_id").read_text()
    except OSError:
        about = platform.node()
    return f".pix2shape-bench-{hashlib.sha256(about.encode()).hexdigest()[:8]}-"


def _about(error: OSError | RuntimeError, parent: Path, path: Path) -> OSError | None:
    """Return an error of the disk as one about `path`; None for any other error.

    An error that names a file is about `path` where that file is in a workspace in `parent`.
    """
    name, number = getattr(error, "filename", None), getattr(error, "errno", None)
    where = path
    if name is None:
        said = [code for code in DISK_ERRORS if os.strerror(code) in str(error)]
        number = number if number in DISK_ERRORS else next(iter(said), None)
    else:
        inside = Path(os.fsdecode(name))
        if inside.parts[: len(parent.parts)] != parent.parts:
            return None
        hidden, *below = inside.parts[len(parent.parts) :] or [""]
        number = number if NAME.fullmatch(hidden) else None
        where = path.joinpath(*below[1:])
    if number is None:
        return None
    return OSError(number, f"cannot be written: {os.strerror(number)}", str(where))


@contextmanager
def run_lock(lock: Path, place: Path, hint: str = "wait until it ends") -> Iterator[None]:
    """Hold a lock for the block: a file, which is removed at the end.

    The lock ends with its process, also where that is killed and processes that it forked live on.
    On a disk without locks nothing is locked.

    Args:
        place: what the run makes, for the error.
        hint: what to do where another run makes it.

    Raises SceneGenError where another run holds the lock; OSError.
    """
    name = os.path.realpath(lock)
    busy = SceneGenError(f"{place}: another run is writing to it", hint=hint)
    if name in _held:  # opening and closing the file would end the lock
        raise busy
    descriptor = os.open(lock, os.O_RDWR | os.O_CREAT, 0o666)
    try:
        if not _taken(lock, descriptor):
            raise busy
        _held.add(name)
        try:
            yield
        finally:
            _held.remove(name)
            with suppress(OSError):
                lock.unlink()
    finally:
        os.close(descriptor)


def _taken(lock: Path, descriptor: int) -> bool:
    """Take the lock if nobody has it; a run that has just ended may have removed the file."""
    if fcntl is None:
        return True
    try:
        fcntl.lockf(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        return lock.exists() and os.path.samestat(os.fstat(descriptor), lock.stat())
    except (BlockingIOError, PermissionError):  # POSIX allows either
        return False
    except OSError:  # a disk without locks
        return True
