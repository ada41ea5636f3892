"""Long runs: open files and memory must not grow with the number of shards and of images."""

import os
import statistics
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from benchmarks.torture.runs import Torture

MANY = "render --n 600 --size 32 --min-visible-pixels 3 --shard-size 2 --seed 3 --out rooms.h5"
LONG = (
    "render --n 100000 --size 32 --min-visible-pixels 3 --shard-size 5000 --seed 3 --out rooms.h5"
)
MOST_OPEN = 64  # files of a process, libraries' and the 32 shards that a reader keeps included
GROWTH, ROOM = 1.05, 20  # by how much memory may grow: a factor, and MB
# Read a row of each shard, twice, and print the largest number of open files.
READER = """
import os, sys
from scenegen.files import trial
from scenegen.rooms.reader import RoomsFile
trial.try_file("rooms.h5")  # as commands do, so that the shards are tried too
most = 0
with RoomsFile("rooms.h5") as rooms:
    for row in [*range(0, len(rooms), 2), *range(0, len(rooms), 2)]:
        rooms.read("depth", row)
        most = max(most, len(os.listdir("/proc/self/fd")))
print(most)
"""


def growth(torture: Torture, _count: int) -> Iterator[tuple[str, str]]:
    """Count open files over runs of many shards, and memory over a run of many images."""
    if not Path("/proc/self/statm").exists():
        yield "open files and memory", "not tried: no /proc"
        return
    where = torture.fresh("many")
    process, samples = _watched(torture, where, MANY)
    yield _files("open files of a run of 300 shards", process, [files for files, _ in samples])
    command = [sys.executable, "-c", READER]
    read = subprocess.Popen(
        command, cwd=where, env=torture.environment, stdout=subprocess.PIPE, text=True
    )
    most = int(read.communicate()[0] or -1)
    yield _files("open files of a reader of 300 shards", read, [most])
    where = torture.fresh("long")
    process, samples = _watched(torture, where, LONG)
    yield _files("open files of a run of 100,000 images", process, [files for files, _ in samples])
    memory = [resident for _, resident in samples]
    quarter = len(memory) // 4
    early, late = (
        statistics.median(memory[quarter : 2 * quarter]),
        statistics.median(memory[-quarter:]),
    )
    told = f"{early:.0f} MB in the second quarter, {late:.0f} MB in the last"
    print(f"memory of all processes: {told}", file=sys.stderr)
    wrong = process.returncode or late > GROWTH * early + ROOM
    yield "memory of a run of 100,000 images", f"{told}" if wrong else ""


def _files(name: str, process: "subprocess.Popen[str]", counts: list[int]) -> tuple[str, str]:
    print(f"{name}: at most {max(counts)}", file=sys.stderr)
    wrong = process.returncode or not 0 < max(counts) < MOST_OPEN
    return name, f"exit {process.returncode}, at most {max(counts)}" if wrong else ""


def _watched(
    torture: Torture, where: Path, words: str
) -> tuple["subprocess.Popen[str]", list[tuple[int, float]]]:
    """Run a command; return its open files and the MB of all its processes, ten times a second."""
    code = "import cli; cli.scenegen()"
    process = subprocess.Popen(
        [sys.executable, "-c", code, *words.split(), "--workers", "2"],
        cwd=where, env=torture.environment, stdout=subprocess.DEVNULL, text=True,
    )  # fmt: skip
    samples = []
    while process.poll() is None:
        with suppress(OSError):  # a process that has just ended
            files = len(os.listdir(f"/proc/{process.pid}/fd"))
            samples.append((files, sum(map(_resident, _family(process.pid)))))
        time.sleep(0.1)
    return process, samples


def _family(number: int) -> list[int]:
    """Return a process and all that it started."""
    children = Path(f"/proc/{number}/task/{number}/children").read_text().split()
    return [number, *(one for child in children for one in _family(int(child)))]


def _resident(number: int) -> float:
    pages = int(Path(f"/proc/{number}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6
