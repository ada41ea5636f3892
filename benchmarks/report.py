"""Run the jobs of a benchmark, each in a process of its own, and print one Markdown table.

This process imports nothing heavy: a child's peak of memory is never counted lower than what its
parent held when it started the child. Everything is written to a temporary folder.
"""

import argparse
import json
import os
import platform
import re
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
    def best(self) -> float:
        """Images a second, fastest repeat; 0 where the job failed."""
        return self.result["images"] / min(self.result["seconds"]) if "note" in self.result else 0.0

    def cells(self) -> list[str]:
        """Return the row's cells."""
        if "error" in self.result:
            return [self.what, *5 * "-", self.result["error"].replace("|", "/")]
        images, seconds = self.result["images"], self.result["seconds"]
        rate = images / statistics.median(seconds)
        numbers = [f"{rate:,.0f}", f"{self.best:,.0f}", f"{1e3 / rate:.2f}"]
        numbers += [f"{images:,} x {len(seconds)}", f"{self.result['peak_mib']:,.0f}"]
        return [self.what, *numbers, self.result["note"]]


class Session:
    """Starts processes one after another, with `folder` for all that they write."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        # Dr.Jit keeps compiled kernels in the home folder: start from none, and leave none behind.
        own = {"HOME": str(folder), "PYTHONUSERBASE": site.getuserbase()}
        self._environment = {**os.environ, **own}

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
        jobs: (folder, quick) -> the jobs in order; those with an empty key make no row.
        head: head of the table's first column.
        print_ratios: prints what the rows, by key, say about each other.
    """
    parser = argparse.ArgumentParser(description=description.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="measure fewer images")
    quick = parser.parse_args().quick
    with tempfile.TemporaryDirectory(prefix="bench-") as folder:
        session = Session(Path(folder))
        _print_machine(session.run("rooms:machine"))
        rows = {}
        for key, what, job, arguments in jobs(folder, quick):
            rows[key] = Row(what, session.run(job, **arguments))
        rows.pop("", None)
        heads = [head, "images/s, median", "best", "ms/image", "images", "MiB", "remarks"]
        ruler = ["---", *["---:"] * 5, "---"]
        for cells in (heads, ruler, *(row.cells() for row in rows.values())):
            print("| " + " | ".join(cells) + " |")
        print(f"\n{notes}\n\nRatios of the best repeats:\n")  # noise only ever adds time
        print_ratios(rows)
        last(session)


def _print_machine(machine: dict[str, Any]) -> None:
    versions = ", ".join(f"{name} {text}" for name, text in machine.get("versions", {}).items())
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    info = Path("/proc/cpuinfo")
    named = re.search(r"model name\s*: (.*)", info.read_text()) if info.exists() else None
    processor = named[1] if named else platform.processor() or platform.machine()
    load = os.getloadavg()[0]
    print(f"{processor}, {cores} cores (load before: {load:.1f}), {platform.system()}")
    print(f"Python {platform.python_version()}, {versions}; variant {machine.get('variant')}\n")
