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


@contextmanager
def run_lock(lock: Path, place: Path, hint: str = "wait for it") -> Iterator[None]:
    """Hold a lock for the block: a file, which is removed at the end.

    The lock of a killed run holds nobody up. On disks without locks nothing is locked.

    Args:
        place: what the run makes, for the error.
        hint: what to do where another run makes it.

    Raises SceneGenError where another run holds the lock; OSError.
    """
    descriptor = os.open(lock, os.O_RDWR | os.O_CREAT, 0o666)
    try:
        if not _ours(lock, descriptor):
            raise SceneGenError(place, "another run that makes it", "", hint)
        try:
            yield
        finally:
            with suppress(OSError):
                lock.unlink()
    finally:
        os.close(descriptor)


def _ours(lock: Path, descriptor: int) -> bool:
    """Take the lock if nobody has it; a run that has just ended may have removed the file."""
    if fcntl is None:
        return True
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        return lock.exists() and os.path.samestat(os.fstat(descriptor), lock.stat())
    except BlockingIOError:
        return False
    except OSError:  # a disk without locks
        return True
