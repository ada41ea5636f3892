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


def repeat(action: Callable[[], Any], repeats: int) -> list[float]:
    """Run an action once to warm up, then return the seconds of each repeat."""
    action()
    return [seconds_of(action) for _ in range(repeats)]


def peak_mib(workers: int = 1) -> float:
    """Return the most memory that this process has held so far, MiB.

    Where it had several worker processes, add as much for each as the largest of them held; what
    they share with each other is then counted more than once.
    """
    unit = 2**20 if sys.platform == "darwin" else 2**10  # bytes there, KiB elsewhere
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    if workers > 1:
        peak += workers * resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
    return peak / unit
