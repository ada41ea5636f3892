"""Runs in surroundings that are not as they should be: folders, pipes and clocks."""

import json
import os
import pty
import shutil
import subprocess
import sys
import termios
import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from benchmarks.torture.runs import Torture, contents
from scenegen.files.manifest import read_manifest

# A clock that jumps 400 days ahead or back whenever it is read, as a library that is loaded first.
# Time that only counts on, which Python takes to measure durations, is left as it is.
JUMPING = """
#define _GNU_SOURCE
#include <sys/time.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>
static long jump(void) {
    static unsigned reads;
    static const long days[] = {0, 400, -400, 30, -1};
    return days[__sync_fetch_and_add(&reads, 1) % 5] * 86400;
}
int clock_gettime(clockid_t id, struct timespec *now) {
    int failed = syscall(SYS_clock_gettime, id, now);
    if (!failed && id == CLOCK_REALTIME) now->tv_sec += jump();
    return failed;
}
int gettimeofday(struct timeval *restrict now, void *restrict zone) {
    struct timespec real;
    clock_gettime(CLOCK_REALTIME, &real);
    now->tv_sec = real.tv_sec, now->tv_usec = real.tv_nsec / 1000;
    return 0;
}
time_t time(time_t *out) {
    struct timespec real;
    clock_gettime(CLOCK_REALTIME, &real);
    if (out) *out = real.tv_sec;
    return real.tv_sec;
}
"""


def read_only(torture: Torture, _count: int) -> Iterator[tuple[str, str]]:
    """Run in a folder that cannot be written to: as root a mount, as permissions do not bind it."""
    where = torture.fresh("read-only")
    mounted = not os.getuid()
    name = f"a read-only folder ({'a tmpfs' if mounted else 'by its permissions'})"
    if mounted and subprocess.run(["mount", "-t", "tmpfs", "none", where], check=False).returncode:
        yield name, "not tried: cannot mount"
        return
    lock, unlock = (["chmod", "500", where], ["chmod", "700", where])
    if mounted:
        lock, unlock = (["mount", "-o", f"remount,{how}", where] for how in ("ro", "rw"))
    try:
        subprocess.run(lock, check=True)
        process = torture.command(where)
        yield name, torture.ended(process, process.communicate()[1].strip())
        subprocess.run(unlock, check=True)
        yield "the same, then writable", torture.goes_on(where)
    finally:
        subprocess.run(["umount", where] if mounted else unlock, check=True)


def pipes(torture: Torture, _count: int) -> Iterator[tuple[str, str]]:
    """Close the streams that a command writes to; its files must not suffer."""
    for stream, number in (("stdout", 1), ("stderr", 2)):
        where = torture.fresh("pipes")
        reading, writing = os.pipe()
        os.close(reading)
        process = torture.command(where, **{"stderr": subprocess.DEVNULL, stream: writing})
        os.close(writing)
        process.communicate()
        yield f"{stream}, a pipe whose reader is gone", _whole(torture, process, "")
        where = torture.fresh("pipes")
        how = {"stderr": subprocess.DEVNULL, "preexec_fn": lambda n=number: os.close(n)}
        process = torture.command(where, **how)  # type: ignore[arg-type]
        process.communicate()
        yield f"{stream}, closed before the start", _whole(torture, process, "")


def clock(torture: Torture, _count: int) -> Iterator[tuple[str, str]]:
    """Let the clock jump, with a progress bar on a terminal, and after a kill too."""
    library = torture.folder / "jumping.so"
    compiler = shutil.which("cc")
    if compiler is None:
        yield "a clock that jumps", "not tried: no C compiler"
        return
    source = library.with_suffix(".c")
    source.write_text(JUMPING)
    command = [compiler, "-shared", "-fPIC", "-O1", "-o", library, source]
    subprocess.run(command, check=True)
    environment = {**torture.environment, "LD_PRELOAD": str(library)}
    code = "import time; print(sorted(time.time() for _ in range(5)))"
    told = subprocess.check_output([sys.executable, "-c", code], env=environment)
    seen = json.loads(told)
    if seen[-1] - seen[0] < 700 * 86400:
        yield "a clock that jumps", "not tried: this Python does not ask the library for the time"
        return
    for workers in ("1", "2"):
        where = torture.fresh("clock")
        started = time.perf_counter()
        process, said = _at_a_terminal(torture, where, workers, environment)
        took = time.perf_counter() - started
        problem = _whole(torture, process, said) or _progress(said) or _durations(where, took)
        yield f"a clock that jumps, workers: {workers}", problem
    where = torture.fresh("clock")
    process = torture.command(where, "2", env=environment)
    while not list(where.glob("rooms-*")) and process.poll() is None:
        time.sleep(0.02)
    process.kill()
    process.communicate()
    place = where / "rooms.manifest.json"  # which may lack the shards of the last moment
    known = read_manifest(place).shards if place.exists() else ()
    kept = {path: path.stat().st_mtime_ns for path in (where / one.file for one in known)}
    process, said = _at_a_terminal(torture, where, "1", environment)
    problem = _whole(torture, process, said) or _progress(said)
    if any(path.stat().st_mtime_ns != when for path, when in kept.items()):
        problem = problem or "complete shards were made again"
    yield "a clock that jumps, and SIGKILL", problem


def _whole(torture: Torture, process: "subprocess.Popen[str]", said: str) -> str:
    problem = torture.ended(process, said, 0)
    return problem or ("" if contents(torture.where) == torture.expected else "other bytes")


def _at_a_terminal(
    torture: Torture, where: Path, workers: str, environment: dict[str, str]
) -> tuple["subprocess.Popen[str]", str]:
    """Run the command with a terminal for its progress bar; return what that shows, too."""
    ours, theirs = pty.openpty()
    termios.tcsetwinsize(theirs, (24, 80))  # there is no progress bar where no width is known
    shown = bytearray()

    def read() -> None:
        with suppress(OSError):  # which is how a terminal ends
            while data := os.read(ours, 4096):
                shown.extend(data)

    reader = threading.Thread(target=read)
    process = torture.command(where, workers, env=environment, stderr=theirs)
    os.close(theirs)
    reader.start()
    process.wait()
    reader.join()
    os.close(ours)
    return process, shown.decode(errors="replace")


def _progress(said: str) -> str:
    return "" if "/400" in said else f"no progress bar: {said[-80:]!r}"


def _durations(where: Path, seconds: float) -> str:
    """Return what is wrong with the seconds that shards took, as the manifest has them."""
    told = [
        shard["seconds"]
        for shard in json.loads((where / "rooms.manifest.json").read_text())["shards"]
    ]
    return "" if min(told) >= 0 and max(told) <= seconds else f"durations of {told} s"
