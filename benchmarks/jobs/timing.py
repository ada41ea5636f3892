"""The clock of a measuring process. It imports nothing heavy, so that `STARTED` is early."""

import resource
import sys
import time
from collections.abc import Callable
from typing import Any

STARTED = time.perf_counter()


def seconds_of(action: Callable[[], Any]) -> float:
    """Return how long an action takes."""
    start = time.perf_counter()
    action()
    return time.perf_counter() - start


def repeat(action: Callable[[], Any], repeats: int) -> list[float]:
    """Run an action once to warm up, then return the seconds of each repeat."""
    action()
    return [seconds_of(action) for _ in range(repeats)]


def peak_mib() -> float:
    """Return the most memory that this process has held so far, MiB."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / (2**20 if sys.platform == "darwin" else 2**10)  # bytes there, KiB elsewhere
