"""New HDF5 files, which get their names when they are complete, and the name of their writer."""

import errno
import importlib.metadata
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import h5py

from scenegen.files.new_file import written_beside

CLOSING_SLACK = 8192  # bytes that HDF5 may need to close a file beyond what it says it needs


@contextmanager
def new_hdf5_file(path: str | Path, overwrite: bool = False) -> Iterator[h5py.File]:
    """Open a new HDF5 file, which gets its name when the block ends well, as `written_beside`."""
    with written_beside(path, overwrite) as temporary, new_hdf5(temporary) as file:
        yield file


@contextmanager
def new_hdf5(path: Path) -> Iterator[h5py.File]:
    """Open a new HDF5 file; on any error it is emptied, as nobody is to read it."""
    file = h5py.File(path, "w", rdcc_nbytes=0)  # without a cache of unwritten chunks
    try:
        yield file
        _check_room_to_close(file, path)
        file.close()
    except BaseException:
        # Where the disk is full, an empty file makes room for HDF5 to close it. A file that it
        # cannot close would crash the process at exit.
        os.truncate(path, 0)
        with suppress(Exception):
            file.close()
        raise


def _check_room_to_close(file: h5py.File, path: Path) -> None:
    """Raise OSError where the disk has no room for what HDF5 still has to write."""
    if not hasattr(os, "statvfs"):
        return
    disk, written = os.statvfs(path), os.stat(path).st_blocks * 512
    if file.id.get_filesize() - written + CLOSING_SLACK > disk.f_bavail * disk.f_frsize:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))


def writer_name() -> str:
    """Return name and version of this program, as files record them."""
    return f"pix2shape-bench {importlib.metadata.version('pix2shape-bench')}"


def program_version() -> dict[str, str]:
    """Return name and version of this program, for workers of a cluster to be compared by."""
    return {"writer": writer_name()}
