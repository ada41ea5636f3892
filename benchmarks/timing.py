"""Times of functions, each in a process of its own, and one Markdown table of them.

Mitsuba's variant, Dr.Jit's thread pool and the peak of the memory belong to a process, so every row
of a table has its own. This process imports nothing heavy: the peak of a child is never counted
lower than what its parent held when it started the child.

    python -m benchmarks.timing MODULE:FUNCTION ARGUMENTS-AS-JSON

runs one function. It returns a record: `seconds` of each repeat, `images`, `busy` (processors), and
maybe `workers` and `note`.
"""

import importlib
import json
import os
import platform
import re
import resource
import site
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tabulate import tabulate


@dataclass(frozen=True)
class Speed:
    """Medians of a row: images a second, and processor time of an image in milliseconds."""

    rate: float
    cpu_ms: float


# The name of a row, "module:function" of this package, and the arguments of the function.
Row = tuple[str, str, dict[str, Any]]


def seconds_of(action: Callable[[], Any]) -> float:
    """Return how long an action takes."""
    start = time.perf_counter()
    action()
    return time.perf_counter() - start


def repeat(action: Callable[[], Any], repeats: int) -> list[float]:
    """Run an action once to warm up, then return the seconds of each repeat."""
    action()
    return [seconds_of(action) for _ in range(repeats)]


def measured(action: Callable[[], Any], repeats: int) -> dict[str, Any]:
    """Return `repeat` as a record, with the processors that were kept busy."""
    action()
    seconds, busy = zip(*(processors_busy(action) for _ in range(repeats)), strict=True)
    return {"seconds": seconds, "busy": statistics.median(busy)}


def processors_busy(action: Callable[[], Any]) -> tuple[float, float]:
    """Return how long an action takes, and how many processors it kept busy meanwhile.

    Worker processes count when they have ended.
    """
    before = _processor_seconds()
    seconds = seconds_of(action)
    return seconds, (_processor_seconds() - before) / seconds


def _processor_seconds() -> float:
    usages = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(usage.ru_utime + usage.ru_stime for usage in usages)


def _peak_mib(workers: int) -> float:
    """Return the largest memory of this process and its workers, which may share parts of it."""
    unit = 2**20 if sys.platform == "darwin" else 2**10  # bytes there, KiB elsewhere
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    if workers > 1:
        peak += workers * resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
    return peak / unit


def print_table(head: str, rows: Iterable[Row], folder: str) -> dict[str, Speed]:
    """Measure rows, one after another, and print their table.

    Args:
        head: head of the first column.
        folder: for everything that is written. It is the home of the processes, too, as Dr.Jit
            keeps compiled kernels there: they start from none.

    Returns:
        Speeds by the name of the row, without those that failed.
    """
    info = Path("/proc/cpuinfo")
    model = re.search(r"model name\s*: (.*)", info.read_text()) if info.exists() else None
    print(f"{model[1] if model else platform.machine()}, {os.cpu_count()} cores,", end=" ")
    print(f"load {os.getloadavg()[0]:.1f}, Python {platform.python_version()}\n")
    environment = {**os.environ, "HOME": folder, "PYTHONUSERBASE": site.getuserbase()}
    cells, speeds = [], {}
    for name, function, arguments in rows:
        print(f"{name} ...", file=sys.stderr, flush=True)
        command = [sys.executable, "-m", "benchmarks.timing", function, json.dumps(arguments)]
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
        if done.returncode:
            print(done.stderr, file=sys.stderr)
            cells.append([name, *6 * "-", "failed"])
            continue
        record = json.loads(done.stdout.splitlines()[-1])
        images, seconds = record["images"], record["seconds"]
        median = statistics.median(seconds)
        cpu_ms = 1e3 * record["busy"] * median / images
        speeds[name] = Speed(images / median, cpu_ms)
        numbers = [f"{images / median:,.0f}", f"{images / min(seconds):,.0f}"]
        numbers += [f"{images:,} x {len(seconds)}", f"{record['busy']:.2f}", f"{cpu_ms:.2f}"]
        cells.append([name, *numbers, f"{record['peak_mib']:,.0f}", record.get("note", "")])
    columns = [
        *(head, "images/s, median", "best", "images", "processors busy", "CPU-ms an image"),
        *("MiB", "remarks"),
    ]
    print(tabulate(cells, columns, "pipe", disable_numparse=True), "\n")
    return speeds


def fastest(speeds: dict[str, Speed], start: str) -> Speed | None:
    """Return the speed of the fastest row whose name starts with `start`."""
    rows = [speed for name, speed in speeds.items() if name.startswith(start)]
    return max(rows, key=lambda speed: speed.rate, default=None)


def print_ratio(what: str, above: Speed | None, below: Speed | None, goal: float) -> None:
    """Print a ratio of rates beside its goal, and that of processor times, unless a row failed.

    On a machine that has other work, processor times say more.
    """
    if above and below:
        rates, times = above.rate / below.rate, below.cpu_ms / above.cpu_ms
        print(f"- {what}: {rates:.2f}, by processor time {times:.2f}; goal {goal:g}")


if __name__ == "__main__":  # not in worker processes, which import this module again
    from scenegen.rendering.backend import select_variant

    select_variant("auto")  # first: the function's module may import Dr.Jit, which looks for LLVM
    module, function = sys.argv[1].split(":")
    result = getattr(importlib.import_module(f"benchmarks.{module}"), function)(
        **json.loads(sys.argv[2])
    )
    print(json.dumps({**result, "peak_mib": _peak_mib(result.get("workers", 1))}))
