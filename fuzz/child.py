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
        program = arguments[0]
        sys.argv = list(arguments)
        return getattr(cli, program).main(arguments[1:], prog_name=program)

    return call(command, folder, limit, stdout)


def call(command: Callable[[], Any], folder: Path, limit: float, stdout: str = "file") -> Run:
    """Run a function as if it were a program, in a child and in a folder."""
    with working_folder() as kept:
        out, err = kept / "out", kept / "err"
        started = time.perf_counter()
        child = os.fork()
        if child == 0:
            _be_the_program(command, folder, out, err, stdout)
        code, used, timed_out = _awaited(child, started + limit)
        seconds = time.perf_counter() - started
        left = _outlived(child)
        streams = [path.read_bytes() if path.exists() else b"" for path in (out, err)]
    return Run(code, seconds, used.ru_maxrss / 1024, timed_out, left, *streams)


def _awaited(child: int, end: float) -> tuple[int, Any, bool]:
    """Wait for a child, or kill its process group; return exit code, use, and whether killed."""
    pause = 0.001
    while True:
        pid, status, used = os.wait4(child, os.WNOHANG)
        if pid:
            return os.waitstatus_to_exitcode(status), used, False
        if time.perf_counter() > end:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(child, signal.SIGKILL)
            _, status, used = os.wait4(child, 0)
            return os.waitstatus_to_exitcode(status), used, True
        time.sleep(pause)
        pause = min(0.02, pause * 1.5)


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
        _limit()
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


def _limit() -> None:
    held = int(Path("/proc/self/statm").read_text().split()[5]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_DATA, (held + MEMORY,) * 2)
    resource.setrlimit(resource.RLIMIT_FSIZE, (LARGEST_FILE,) * 2)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def _redirect(out: Path, err: Path, stdout: str) -> None:
    """Open the standard streams as a shell would, and let Python begin with them."""
    nothing = os.open(os.devnull, os.O_RDONLY)
    writable = os.O_WRONLY | os.O_CREAT
    if stdout == "closed pipe":
        reader, first = os.pipe()
        os.close(reader)
    else:
        first = os.open("/dev/full" if stdout == "full" else out, writable)
    second = os.open(err, writable)
    for number, stream in enumerate((nothing, first, second)):
        os.dup2(stream, number)
    sys.stdin = io.TextIOWrapper(io.FileIO(0), "utf-8")
    sys.stdout = io.TextIOWrapper(io.BufferedWriter(io.FileIO(1, "w")), "utf-8")
    sys.stderr = io.TextIOWrapper(
        io.FileIO(2, "w"), "utf-8", "backslashreplace", write_through=True
    )
    sys.__stdin__, sys.__stdout__, sys.__stderr__ = sys.stdin, sys.stdout, sys.stderr


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
