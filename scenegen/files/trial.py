"""Files of strangers are tried in another process first: broken ones can hang or crash HDF5.

HDF5 follows addresses that the file states. Where these lead in circles it never returns, and no
Python code can stop it; so a process that may be killed looks at everything that is not checked in
`input_file` before: names, attributes, texts, and where chunks lie.
"""

import math
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

from scenegen.common.errors import FileFormatError, SceneGenError
from scenegen.common.threads import ONE_THREAD
from scenegen.files.pool import ended, python_command

SECONDS = 8.0  # of a processor, for any file
BYTES_A_SECOND = 20e6  # that honest content takes beyond that
PATIENCE = 10  # by how much longer it may take by the clock, on a busy machine or a slow disk
MEMORY = 2**31  # bytes of address space, beyond what Python takes
BLOCK_ROWS = 1024  # of texts, read at once
OUT_OF_MEMORY = 3  # exit code
READY = "ready"
_Identity = tuple[int, int, int, int]
_ACCEPTED: set[_Identity] = set()  # by this process
SIGNATURE = b"\x89HDF\r\n\x1a\n"


def try_file(path: str | Path) -> None:
    """Return where the file is not HDF5, or another process can read its structure.

    That its content is right is not said. Raises FileFormatError where HDF5 crashes, does not end
    in time, or takes more memory than honest files need.
    """
    if not os.path.isfile(path) or _identity(path) in _ACCEPTED or not is_hdf5(path):
        return
    identity = _identity(path)
    limit = SECONDS + os.path.getsize(path) / BYTES_A_SECOND
    command = python_command(f"from {__name__} import _read_structure; _read_structure()")
    words = [os.path.abspath(path), f"{MEMORY}", f"{limit}"]
    try:
        done = subprocess.run(
            [*command, *words], env={**os.environ, **ONE_THREAD}, stdin=subprocess.DEVNULL,
            capture_output=True, text=True, errors="replace",
            timeout=PATIENCE * limit, check=False,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        raise _unread(path, limit) from None
    except OSError as error:
        what = f"No process can be started to try {path} ({error.strerror})"
        raise SceneGenError(what, hint="raise the limit on processes (ulimit -u)") from error
    _judge(path, done, limit)
    _ACCEPTED.add(identity)


def _judge(path: str | Path, done: "subprocess.CompletedProcess[str]", limit: float) -> None:
    """Raise FileFormatError where the file is at fault, and SceneGenError where the trial is."""
    code, (ready, *lower) = done.returncode, done.stdout.split() or [""]
    if code == 0:
        return
    killed, slow = (-getattr(signal, name, 0) for name in ("SIGKILL", "SIGXCPU"))
    if code == -getattr(signal, "SIGALRM", 0):
        raise _unread(path, limit)
    if ready != READY:
        last = (done.stderr.strip().splitlines() or [ended(code)])[-1]
        why, hint = f"it could not begin: {last:.200}", "raise the limits of this process (ulimit)"
    elif code in (killed, slow) and "cpu" in lower:
        why, hint = "it used all of the processor time that is allowed here", "raise ulimit -t"
    elif "memory" in lower and code != slow:
        why = f"memory is limited here, and the process exited with {ended(code)}"
        hint = "raise ulimit -v"
    elif code == killed:
        why, hint = "it was killed", "memory may be short"
    else:
        found = _what_happened(code, limit)
        raise FileFormatError(path, found, "a file as h5py writes it", "the file is broken")
    what = f"{path} cannot be tried in another process, as is done before a stranger's file is read"
    raise SceneGenError(what, why, "", hint)


def _unread(path: str | Path, limit: float) -> FileFormatError:
    found = f"a structure that HDF5 had not read after {PATIENCE * limit:.0f} s"
    hint = "broken, or the machine is very busy"
    return FileFormatError(path, found, "a file as h5py writes it", hint)


def _what_happened(code: int, limit: float) -> str:
    """Say what an exit code of the other process tells of the file."""
    if code == -getattr(signal, "SIGXCPU", 0):
        return f"a structure that HDF5 had not read after {math.ceil(limit)} s of a processor"
    if code == OUT_OF_MEMORY:
        return "texts or attributes that take more than 2 GiB of memory"
    if code < 0:
        return f"a structure on which HDF5 crashes (signal {-code})"
    return f"a structure that h5py cannot look at (exit code {code})"


def _identity(path: str | Path) -> _Identity:
    status = os.stat(path)
    return status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns


def is_hdf5(path: str | Path) -> bool:
    """Return whether the signature is at 0, 512, 1024, 2048, ...: other bytes may come first."""
    place = 0
    with open(path, "rb") as file:
        while start := file.read(len(SIGNATURE)):
            if start == SIGNATURE:
                return True
            place = max(512, 2 * place)
            file.seek(place)
    return False


def _read_structure() -> None:
    """Read everything of a file but the values that are numbers; the child alone loads h5py.

    It prints READY first, and which limits of this process are lower than those of the trial.
    Errors of HDF5 are left to the caller, who will meet and tell them, but for those of memory.
    """
    import h5py

    from scenegen.files.input_file import HDF5_ERRORS, faults, is_virtual, virtual_sources

    def look(_name: str, item: h5py.Group | h5py.Dataset) -> None:
        dict(item.attrs)
        if not isinstance(item, h5py.Dataset):
            return
        if is_virtual(item):
            virtual_sources(item)
        elif h5py.check_vlen_dtype(item.dtype) is not None:
            for first in range(0, len(item) if item.shape else 0, BLOCK_ROWS):
                item[first : first + BLOCK_ROWS]

    path, memory, seconds = sys.argv[1], int(sys.argv[2]), float(sys.argv[3])
    print(READY, *_limit(memory, seconds), flush=True)  # when everything is imported
    try:
        with h5py.File(path, "r") as file:
            dict(file.attrs)
            # `faults` counts all chunks, for which HDF5 looks at where each lies.
            if all(fault.virtual for fault in list(faults(file))):
                file.visititems(look)
    except HDF5_ERRORS as error:
        if isinstance(error, MemoryError) or "alloc" in str(error):
            sys.exit(OUT_OF_MEMORY)


def _limit(memory: int, seconds: float) -> list[str]:
    """Let this process take so much more memory than now, and so many seconds of a processor.

    Returns of which it may not have so much, as limits of this process are lower.
    """
    lower: list[str] = []
    if hasattr(signal, "alarm"):  # ends this process where its parent was killed
        signal.alarm(math.ceil(PATIENCE * seconds) + 1)
    if os.path.exists("/proc/self/statm"):
        import resource

        memory += int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        until = math.ceil(time.process_time() + seconds)
        wanted = {"memory": (resource.RLIMIT_AS, memory), "cpu": (resource.RLIMIT_CPU, until)}
        for name, (kind, most) in wanted.items():
            soft, hard = resource.getrlimit(kind)
            if soft == resource.RLIM_INFINITY or most <= soft:
                resource.setrlimit(kind, (most, hard))
            else:
                lower.append(name)
    return lower
