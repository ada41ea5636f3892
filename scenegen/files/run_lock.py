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


_held: set[int] = set()  # descriptors of locks


def _let_go() -> None:
    """Close the locks in a forked process, which may outlive a run that was killed."""
    for descriptor in _held:
        os.close(descriptor)
    _held.clear()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_let_go)


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
    _held.add(descriptor)
    try:
        if not _ours(lock, descriptor):
            raise SceneGenError(place, "another run that writes there", "", hint)
        try:
            yield
        finally:
            with suppress(OSError):
                lock.unlink()
    finally:
        if descriptor in _held:  # or this is a forked process
            _held.remove(descriptor)
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
