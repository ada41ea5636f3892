"""The lock of a run, which keeps a second one from writing to the same place."""

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from scenegen.common.errors import SceneGenError

try:
    import fcntl
except ImportError:  # Windows has no such locks
    fcntl = None  # type: ignore[assignment]

_held: set[str] = set()  # locks of this process, which the system would let it take twice


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
