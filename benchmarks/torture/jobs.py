"""Runs of the size of users' jobs, by name: each must end well, within a limit of memory."""

import shlex
import subprocess
import sys
from collections.abc import Sequence
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


class Job(NamedTuple):
    """Commands, one after another, and the most memory, MB, that a process of them may take.

    Limits are above what was measured, and far below what growth would take.
    """

    commands: Sequence[str]
    most: int


JOBS = {
    "interiors": Job(
        [f"scenegen render --preset interiors --n 5000 --spp 1 --no-denoise {SMALL}"], 1400
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
