"""Runs of the size of users' jobs: each must end well, within a limit of memory.

In long runs, open files and memory must not grow with the number of shards and of images.
"""

import os
import shlex
import statistics
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from benchmarks.torture.runs import Results, Torture

SMALL = "--size 32 --min-visible-pixels 3 --workers 1 --out rooms.h5"
STREAM = "import scenegen\nfor _ in scenegen.RoomStream('shapes', batch=64, stop=50_000): pass"
# Runs a command; prints its exit code and the peak, MB, of its largest process. This one is small,
# as a process counts the peak of the one that started it, too.
WATCHED = """
import resource, subprocess, sys
done = subprocess.run([sys.executable, "-c", *sys.argv[1:]], stdout=subprocess.DEVNULL)
print(done.returncode, resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1000)
"""
MANY, LONG = "--n 600 --shard-size 2", "--n 100000 --shard-size 5000"
RENDER = "render {} --size 32 --min-visible-pixels 3 --seed 3 --out rooms.h5 --workers 2"
MOST_OPEN = 64  # files of a process, libraries' and the 32 shards that a reader keeps included
GROWTH, ROOM = 1.05, 20  # by how much memory may grow: a factor, and MB
# Read a row of each shard, twice, and print the largest number of open files.
READER = """
import os, sys
from scenegen.rooms.reader import RoomsFile
most = 0
with RoomsFile("rooms.h5") as rooms:
    for row in [*range(0, len(rooms), 2), *range(0, len(rooms), 2)]:
        rooms.read("depth", row)
        most = max(most, len(os.listdir("/proc/self/fd")))
print(most)
"""


class Job(NamedTuple):
    """Commands, one after another, and the most memory, MB, that a process of them may take.

    Limits are above what was measured, and far below what growth would take.
    """

    commands: Sequence[str]
    most: int


JOBS = {
    # 0.9 GB stay between launches; one of 16 rooms takes up to 0.6 GB more (1,522 MB measured).
    "interiors": Job(
        [f"scenegen render --preset interiors --n 5000 --spp 1 --no-denoise {SMALL}"], 1600
    ),
    "shapes": Job([f"scenegen render --n 50000 {SMALL}"], 500),
    "objects": Job([f"scenegen render --preset shapenet --n 20000 {SMALL}"], 900),
    "questions": Job(
        [
            "iqtt make-split --train 20000 --labeled 50 --val 30 --test 60 --size 32"
            " --min-cube-pixels 1 --workers 1 --out split"
        ],
        700,
    ),
    "scores": Job(
        [
            f"scenegen render --n 20000 {SMALL}",
            "bench baseline oracle --data rooms.h5 --out scored.h5",
            "bench score scored.h5 --truth rooms.h5 --json scores.json --processes 1",
        ],
        700,
    ),
    "stream": Job([f"python {shlex.quote(STREAM)}"], 800),
}


def job(name: str, torture: Torture, _count: int) -> Results:
    """Run a job in a fresh folder."""
    yield f"a job of a user's size: {name}", run_job(name, torture.fresh("job"))


def run_job(name: str, folder: Path) -> str:
    """Run a job's commands in a folder; return what is wrong, or nothing."""
    for command in JOBS[name].commands:
        program, *words = shlex.split(command)
        if program != "python":
            words = [f"import cli; cli.{program}()", *words]
        run = [sys.executable, "-c", WATCHED, *words]
        done = subprocess.run(run, cwd=folder, stdout=subprocess.PIPE, text=True, check=True)
        code, peak = map(float, done.stdout.split())
        print(f"{command[:70]}: {peak:.0f} MB", file=sys.stderr)
        if code:
            return f"exit {code:.0f}: {command}"
        if peak > JOBS[name].most:
            return f"{peak:.0f} MB: {command}"
    return ""


def growth(torture: Torture, _count: int) -> Results:
    """Count open files over runs of many shards, and memory over a run of many images."""
    if not Path("/proc/self/statm").exists():
        yield "open files and memory", "not tried: no /proc"
        return
    where = torture.fresh("many")
    files, _ = _watched(torture, MANY)
    yield "open files of a run of 300 shards", _too_many(files)
    read = subprocess.run(
        [sys.executable, "-c", READER], cwd=where, env=torture.environment,
        stdout=subprocess.PIPE, text=True, check=False,
    )  # fmt: skip
    problem = _too_many([int(read.stdout or 0)])
    yield "open files of a reader of 300 shards", problem
    torture.fresh("long")
    files, memory = _watched(torture, LONG)
    yield "open files of a run of 100,000 images", _too_many(files)
    quarter = len(memory) // 4
    early = statistics.median(memory[quarter : 2 * quarter])
    late = statistics.median(memory[-quarter:])
    sizes = f"{early:.0f} MB in the second quarter, {late:.0f} MB in the last"
    print(f"memory of all processes: {sizes}", file=sys.stderr)
    yield "memory of a run of 100,000 images", sizes if late > GROWTH * early + ROOM else ""


def _too_many(counts: Sequence[int]) -> str:
    print(f"at most {max(counts)} open files", file=sys.stderr)
    return "" if 0 < max(counts) < MOST_OPEN else f"at most {max(counts)}"


def _watched(torture: Torture, options: str) -> tuple[list[int], list[float]]:
    """Run a command; return its open files and the MB of all its processes, ten times a second.

    The files are [0] where the command failed.
    """
    words = RENDER.format(options).split()
    process = subprocess.Popen(
        [sys.executable, "-c", "import cli; cli.scenegen()", *words],
        cwd=torture.where, env=torture.environment, stdout=subprocess.DEVNULL,
    )  # fmt: skip
    files, memory = [0], []
    while process.poll() is None:
        with suppress(OSError):  # a process that has just ended
            files.append(len(os.listdir(f"/proc/{process.pid}/fd")))
            memory.append(sum(map(_resident, _family(process.pid))))
        time.sleep(0.1)
    return ([0] if process.returncode else files), memory


def _family(number: int) -> list[int]:
    """Return a process and all that it started."""
    children = Path(f"/proc/{number}/task/{number}/children").read_text().split()
    return [number, *(member for child in children for member in _family(int(child)))]


def _resident(number: int) -> float:
    pages = int(Path(f"/proc/{number}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6
