"""Run the jobs of a benchmark, each in a process of its own, and print one Markdown table.

This process imports nothing heavy: a child's peak of memory is never counted lower than what its
parent held when it started the child. Everything is written to a temporary folder.
"""

import argparse
import json
import os
import platform
import site
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

# Key of the row, its first cell, "module:function" of `jobs`, and the function's arguments.
Job = tuple[str, str, str, dict[str, Any]]


@dataclass(frozen=True)
class Row:
    """A row of the table. `result` holds seconds of each repeat, images, note and peak_mib."""

    what: str
    result: dict[str, Any]

    @property
    def rate(self) -> float:
        """Images a second, median of the repeats; 0 where the job failed."""
        return self._rate(statistics.median)

    @property
    def best(self) -> float:
        """Images a second, fastest repeat; 0 where the job failed."""
        return self._rate(min)

    def _rate(self, choose: Any) -> float:
        if "error" in self.result:
            return 0.0
        return float(self.result["images"] / choose(self.result["seconds"]))

    def cells(self) -> list[str]:
        """Return the row's cells."""
        if "error" in self.result:
            return [self.what, "-", "-", "-", "-", "-", self.result["error"].replace("|", "/")]
        repeats = len(self.result["seconds"])
        return [
            self.what,
            f"{self.rate:,.0f}",
            f"{self.best:,.0f}",
            f"{1e3 / self.rate:.2f}",
            f"{self.result['images']:,} x {repeats}",
            f"{self.result['peak_mib']:,.0f}",
            self.result["note"],
        ]


class Session:
    """Starts processes one after another, with `folder` for all that they write."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        # Dr.Jit keeps compiled kernels in the home folder: start from none, and leave none behind.
        self._environment = {
            **os.environ,
            "HOME": str(folder),
            "PYTHONUSERBASE": site.getuserbase(),
        }

    def run(self, job: str, **arguments: Any) -> dict[str, Any]:
        """Return what a job of `benchmarks.jobs` returns; {"error": text} where it fails."""
        shown = " ".join(str(v) for k, v in arguments.items() if k not in ("rooms", "folder"))
        print(f"{job} {shown} ...", end=" ", file=sys.stderr, flush=True)
        command = [sys.executable, "-m", "benchmarks.jobs", job, json.dumps(arguments)]
        seconds, done = self.timed(command)
        print(f"{seconds:.0f} s", file=sys.stderr)
        if done.returncode:
            lines = done.stderr.strip().splitlines() or [f"exit code {done.returncode}"]
            print(done.stderr, file=sys.stderr)
            return {"error": lines[-1]}
        result: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
        return result

    def timed(self, command: list[str]) -> tuple[float, subprocess.CompletedProcess[str]]:
        """Return how many seconds a command takes, and how it ended."""
        start = time.perf_counter()
        done = subprocess.run(
            command, env=self._environment, capture_output=True, text=True, check=False
        )
        return time.perf_counter() - start, done


def print_report(
    description: str,
    jobs: Callable[[str, bool], Iterator[Job]],
    head: str,
    notes: str,
    print_ratios: Callable[[dict[str, Row]], None],
    last: Callable[[Session], None] = lambda session: None,
) -> None:
    """Read the command line, run the jobs, and print machine, table and ratios.

    Args:
        description: first line of `--help`.
        jobs: (folder, quick) -> the jobs in order; those with an empty key make no row.
        head: of the table's first column.
        notes: below the table.
        print_ratios: prints what the rows, by key, say about each other.
        last: prints something more.
    """
    parser = argparse.ArgumentParser(description=description.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="measure fewer images")
    quick = parser.parse_args().quick
    with tempfile.TemporaryDirectory(prefix="bench-") as folder:
        session = Session(Path(folder))
        _print_machine(session.run("rooms:machine"))
        rows = {}
        for key, what, job, arguments in jobs(folder, quick):
            result = session.run(job, **arguments)
            if key:
                rows[key] = Row(what, result)
        cells = [head, "images/s, median", "best", "ms/image", "images", "MiB", "remarks"]
        print("| " + " | ".join(cells) + " |")
        print("| --- |" + " ---: |" * (len(cells) - 2) + " --- |")
        for row in rows.values():
            print("| " + " | ".join(row.cells()) + " |")
        print(f"\n{notes}\n\nRatios of the best repeats:\n")  # noise only ever adds time
        print_ratios(rows)
        last(session)


def _print_machine(machine: dict[str, Any]) -> None:
    versions = ", ".join(f"{name} {text}" for name, text in machine.get("versions", {}).items())
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    load = os.getloadavg()[0]
    print(f"{_processor()}, {cores} cores (load before: {load:.1f}), {platform.system()}")
    print(f"Python {platform.python_version()}, {versions}; variant {machine.get('variant')}\n")


def _processor() -> str:
    info = Path("/proc/cpuinfo")
    lines = info.read_text().splitlines() if info.exists() else []
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()
