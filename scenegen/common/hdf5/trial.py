"""A file is tried in another process first, as broken HDF5 files can hang or crash the library.

HDF5 follows addresses that the file states. Where these lead in circles it never returns, and no
Python code can stop it; so a process that may be killed looks at everything that is not checked in
`input_file` before: names, attributes, texts, and where chunks lie.
"""

import math
import os
import signal
import subprocess
import sys
from pathlib import Path

from scenegen.common.errors import FileFormatError

SECONDS = 8.0  # of a processor, for any file
BYTES_A_SECOND = 20e6  # that honest content takes beyond that
PATIENCE = 10  # by how much longer it may take by the clock, on a busy machine or a slow disk
MEMORY = 2**31  # bytes of address space, beyond what Python takes
BLOCK_ROWS = 1024  # of texts, read at once
OUT_OF_MEMORY = 3  # exit code
_ACCEPTED: set[tuple[int, int, int, int]] = set()  # by this process
SIGNATURE = b"\x89HDF\r\n\x1a\n"


def try_file(path: str | Path) -> None:
    """Return where the file is not HDF5, or another process can read its structure.

    That its content is right is not said. Raises FileFormatError where HDF5 crashes, does not end
    in time, or takes more memory than honest files need.
    """
    if not os.path.isfile(path) or not _is_hdf5(path):
        return
    status = os.stat(path)
    identity = status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns
    if identity in _ACCEPTED:
        return
    limit = SECONDS + os.path.getsize(path) / BYTES_A_SECOND
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    # -P: a file h5py.py in the working directory must not be imported.
    command = [sys.executable, "-P", "-m", __name__, os.path.abspath(path)]
    command += [str(MEMORY), str(math.ceil(limit)), str(math.ceil(PATIENCE * limit) + 1)]
    try:
        done = subprocess.run(
            command,
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            timeout=PATIENCE * limit,
            check=False,
        )
    except subprocess.TimeoutExpired:
        waited = f"a structure that HDF5 had not read after {PATIENCE * limit:.0f} s"
        raise FileFormatError(
            path, waited, "a file as h5py writes it", "broken, or the machine is very busy"
        ) from None
    if hasattr(signal, "SIGXCPU") and done.returncode == -signal.SIGXCPU:
        spent = f"{math.ceil(limit)} s of a processor"
        raise _refusal(path, f"a structure that HDF5 had not read after {spent}")
    if done.returncode == OUT_OF_MEMORY:
        raise _refusal(path, "texts or attributes that take more than 2 GiB of memory")
    if done.returncode < 0:
        raise _refusal(path, f"a structure on which HDF5 crashes (signal {-done.returncode})")
    if done.returncode:
        raise _refusal(path, f"a structure that h5py cannot look at (exit code {done.returncode})")
    _ACCEPTED.add(identity)


def _refusal(path: str | Path, found: str) -> FileFormatError:
    return FileFormatError(path, found, "a file as h5py writes it", "the file is broken")


def _is_hdf5(path: str | Path) -> bool:
    """Return whether the signature is at 0, 512, 1024, 2048, ...: other bytes may come first."""
    place = 0
    with open(path, "rb") as file:
        while start := file.read(len(SIGNATURE)):
            if start == SIGNATURE:
                return True
            place = max(512, 2 * place)
            file.seek(place)
    return False


def _read_structure(path: str, memory: int, seconds: int) -> None:
    """Read everything of a file but the values that are numbers; the child alone loads h5py.

    Errors of HDF5 are left to the caller, who will meet and tell them, but for those of memory.
    """
    import h5py

    from scenegen.common.hdf5.input_file import HDF5_ERRORS, faults

    def look(_name: str, item: h5py.Group | h5py.Dataset) -> None:
        dict(item.attrs)
        if isinstance(item, h5py.Dataset):
            if item.chunks:
                item.id.chunk_iter(lambda chunk: None)
            if h5py.check_string_dtype(item.dtype) is not None:
                for first in range(0, len(item) if item.shape else 0, BLOCK_ROWS):
                    item[first : first + BLOCK_ROWS]

    if os.path.exists("/proc/self/statm"):
        _limit(memory, seconds)
    try:
        with h5py.File(path, "r") as file:
            dict(file.attrs)
            if not list(faults(file)):
                file.visititems(look)
    except HDF5_ERRORS as error:
        if isinstance(error, MemoryError) or "alloc" in str(error):
            sys.exit(OUT_OF_MEMORY)


def _limit(memory: int, seconds: int) -> None:
    """Let this process take so much more memory, and so many seconds of a processor in all."""
    import resource

    memory += int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 1))


if __name__ == "__main__":
    if hasattr(signal, "alarm"):
        signal.alarm(int(sys.argv[4]))  # ends this process where its parent was killed
    _read_structure(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]))
