"""One run of a command in a child of this process, which has imported what commands need.

Starting Python and importing costs a second; a child that is forked from a process that has done
so costs a few milliseconds. The child is the leader of its own process group, may take a bounded
amount of memory, and is killed with all its own children when its time is over.
"""

import atexit
import contextlib
import io
import os
import resource
import shutil
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

MEMORY = 4 * 2**30  # bytes that a child may ask for beyond what it starts with
LARGEST_FILE = 2**31  # bytes that it may write
TRIAL = 3.0  # seconds after which an HDF5 file counts as one on which HDF5 hangs; cases are tiny
GRACE = 2.0  # seconds that helpers of a child, such as multiprocessing's, may outlive it


@dataclass(frozen=True)
class Run:
    """What came of a command.

    Attributes:
        code: exit code, or minus the number of the signal that ended it.
        seconds: wall time.
        megabytes: largest resident memory of it and of each of its children.
        timed_out: whether it was killed as its time was over.
        left: whether one of its processes outlived it.
    """

    code: int
    seconds: float
    megabytes: float
    timed_out: bool
    left: bool
    out: bytes
    err: bytes


def run(arguments: list[str], folder: Path, limit: float, stdout: str = "file") -> Run:
    """Run a command in a folder for some seconds at most."""

    def command() -> Any:
        import cli
        from scenegen.files import trial

        trial.SECONDS = TRIAL
        sys.argv = list(arguments)
        return getattr(cli, arguments[0]).main(arguments[1:], prog_name=arguments[0])

    return call(command, folder, limit, stdout)


def call(command: Callable[[], Any], folder: Path, limit: float, stdout: str = "file") -> Run:
    """Run a function as if it were a program, in a child and in a folder."""
    with working_folder() as kept:
        out, err = kept / "out", kept / "err"
        start = time.perf_counter()
        child = os.fork()
        if child == 0:
            _be_the_program(command, folder, out, err, stdout)
        status, usage, timed_out = _wait(child, start + limit)
        seconds = time.perf_counter() - start
        left = _outlived(child)
        streams = [path.read_bytes() if path.exists() else b"" for path in (out, err)]
    code = os.waitstatus_to_exitcode(status)
    return Run(code, seconds, usage.ru_maxrss / 1024, timed_out, left, *streams)


def _wait(child: int, end: float) -> tuple[int, Any, bool]:
    """Wait for a child, or kill its process group; return status, usage, and whether killed."""
    pause = 0.001
    while time.perf_counter() < end:
        pid, status, usage = os.wait4(child, os.WNOHANG)
        if pid:
            return status, usage, False
        time.sleep(pause)
        pause = min(0.02, pause * 1.5)
    with contextlib.suppress(ProcessLookupError):
        os.killpg(child, signal.SIGKILL)
    return *os.wait4(child, 0)[1:], True


def _outlived(group: int) -> bool:
    """Return whether processes of a group stay; they are killed."""
    end = time.perf_counter() + GRACE
    try:
        while time.perf_counter() < end:
            os.killpg(group, 0)
            time.sleep(0.01)
        os.killpg(group, signal.SIGKILL)
    except ProcessLookupError:
        return False
    return True


def _be_the_program(
    command: Callable[[], Any], folder: Path, out: Path, err: Path, stdout: str
) -> None:
    """Do in the child what the interpreter does for a program; never return."""
    code = 70
    try:
        os.setpgid(0, 0)
        os.chdir(folder)
        held = int(Path("/proc/self/statm").read_text().split()[5]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_DATA, (held + MEMORY,) * 2)
        resource.setrlimit(resource.RLIMIT_FSIZE, (LARGEST_FILE,) * 2)
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        _redirect(out, err, stdout)
        home = folder / ".home"
        home.mkdir(exist_ok=True)
        os.environ.update(HOME=str(home), XDG_CACHE_HOME=str(home), TMPDIR=str(home))
        tempfile.tempdir = None
        code = _exit_code(command)
        atexit._run_exitfuncs()
        with contextlib.suppress(OSError, ValueError):
            sys.stderr.flush()
        try:
            sys.stdout.flush()
        except (OSError, ValueError):
            code = 120  # as Python itself
    finally:
        os._exit(code)


def _exit_code(command: Callable[[], Any]) -> int:
    try:
        command()
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else int(end.code is not None)
    except BaseException:  # as the interpreter does
        sys.excepthook(*sys.exc_info())
        return 1
    return 0


def _redirect(out: Path, err: Path, stdout: str) -> None:
    """Open the standard streams as a shell would, and let Python begin with them."""
    writable = os.O_WRONLY | os.O_CREAT
    if stdout == "closed pipe":
        reader, first = os.pipe()
        os.close(reader)
    else:
        first = os.open("/dev/full" if stdout == "full" else out, writable)
    for number, stream in enumerate((os.open(os.devnull, os.O_RDONLY), first)):
        os.dup2(stream, number)
    os.dup2(os.open(err, writable), 2)
    sys.stdin = sys.__stdin__ = io.TextIOWrapper(io.FileIO(0), "utf-8")
    sys.stdout = sys.__stdout__ = io.TextIOWrapper(io.BufferedWriter(io.FileIO(1, "w")), "utf-8")
    sys.stderr = sys.__stderr__ = io.TextIOWrapper(
        io.FileIO(2, "w"), "utf-8", "backslashreplace", write_through=True
    )


@contextlib.contextmanager
def working_folder() -> Iterator[Path]:
    """Make a folder that is gone afterwards.

    A `tempfile.TemporaryDirectory` would be removed by every child at its exit.
    """
    name = tempfile.mkdtemp(prefix="fuzz-")
    try:
        yield Path(name).resolve()
    finally:
        shutil.rmtree(name, ignore_errors=True)
