"""A file is tried in another process first, as broken HDF5 files can hang or crash the library.

HDF5 follows addresses that the file states. Where these lead in circles it never returns, and no
Python code can stop it; so a process that may be killed looks at everything that is not checked in
`input_file` before: names, attributes, texts, and where chunks lie.
"""

import os
import subprocess
import sys
from pathlib import Path

import h5py

from scenegen.common.errors import FileFormatError
from scenegen.common.input_file import HDF5_ERRORS, faults

SECONDS = 8.0  # for any file
BYTES_A_SECOND = 20e6  # that a slow disk and honest content take beyond that
MEMORY = 2**31  # bytes of address space, beyond what Python takes
OUT_OF_MEMORY = 3  # exit code
SIGNATURE = b"\x89HDF\r\n\x1a\n"


def try_file(path: str | Path) -> None:
    """Return where the file is not HDF5, or another process can read its structure.

    That its content is right is not said. Raises FileFormatError where HDF5 crashes, does not end
    in time, or takes more memory than honest files need.
    """
    if not os.path.isfile(path) or not _is_hdf5(path):
        return
    limit = SECONDS + os.path.getsize(path) / BYTES_A_SECOND
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    # -P: a file h5py.py in the working directory must not be imported.
    command = [sys.executable, "-P", "-m", __name__, os.path.abspath(path), str(MEMORY)]
    try:
        done = subprocess.run(
            command,
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            timeout=limit,
            check=False,
        )
    except subprocess.TimeoutExpired:
        raise _refusal(path, f"a structure that HDF5 had not read after {limit:.0f} s") from None
    if done.returncode == OUT_OF_MEMORY:
        raise _refusal(path, "texts or attributes that take more than 2 GiB of memory")
    if done.returncode < 0:
        raise _refusal(path, f"a structure on which HDF5 crashes (signal {-done.returncode})")


def _refusal(path: str | Path, found: str) -> FileFormatError:
    return FileFormatError(path, found, "a file as h5py writes it", "the file is broken")


def _is_hdf5(path: str | Path) -> bool:
    with open(path, "rb") as file:
        return file.read(len(SIGNATURE)) == SIGNATURE or h5py.is_hdf5(path)


def _read_structure(path: str) -> None:
    """Read everything of a file but the values that are numbers."""
    with h5py.File(path, "r") as file:
        unsafe = {fault.name for fault in faults(file)}
        dict(file.attrs)

        def look(_name: str, item: h5py.Group | h5py.Dataset) -> None:
            dict(item.attrs)
            if isinstance(item, h5py.Dataset):
                if item.chunks:
                    item.id.chunk_iter(lambda chunk: None)
                if h5py.check_string_dtype(item.dtype) is not None:
                    for row in range(len(item) if item.shape else 0):
                        item[row]

        if not unsafe:
            file.visititems(look)


def _limit_memory(most: int) -> None:
    import resource

    most += int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (most, most))


if __name__ == "__main__":
    if os.path.exists("/proc/self/statm"):
        _limit_memory(int(sys.argv[2]))
    try:
        _read_structure(sys.argv[1])
    except HDF5_ERRORS as error:
        if isinstance(error, MemoryError) or "alloc" in str(error):
            sys.exit(OUT_OF_MEMORY)
        # The caller will meet all other errors, and tell them.
