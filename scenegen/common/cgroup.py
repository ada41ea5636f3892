"""What the kernel grants this process: processors, and memory, by the files of its cgroups.

Version 2 has one tree of cgroups, version 1 one for each kind of resource. A container may see its
own cgroup at the root.
"""

import math
import os
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

ROOT = Path("/sys/fs/cgroup")
SELF = Path("/proc/self/cgroup")


def processors() -> int:
    """Return how many processors this process may use: its affinity and its cgroup limit both."""
    count = os.cpu_count() or 1
    if hasattr(os, "sched_getaffinity"):
        count = len(os.sched_getaffinity(0))
    return max(1, math.ceil(min(count, processor_limit())))


def processor_limit(root: Path = ROOT, self_file: Path = SELF) -> float:
    """Return the least limit on processor time of this process's cgroups; inf for none.

    `docker --cpus 1.5` sets 1.5.
    """
    return min((_limit_in(folder) for folder in _folders("cpu", root, self_file)), default=math.inf)


def _limit_in(folder: Path) -> float:
    with suppress(OSError, ValueError):
        quota, period = (folder / "cpu.max").read_text().split()
        return int(quota) / int(period)  # "max" is none
    with suppress(OSError, ValueError):
        quota, period = ((folder / f"cpu.cfs_{n}_us").read_text() for n in ("quota", "period"))
        return int(quota) / int(period) if int(quota) > 0 else math.inf
    return math.inf


def oom_kills(root: Path = ROOT, self_file: Path = SELF) -> int:
    """Return how many processes of this cgroup the kernel has killed for memory; 0 if unknown."""
    for folder in _folders("memory", root, self_file):
        for name in ("memory.events", "memory.oom_control"):
            with suppress(OSError, ValueError, KeyError):
                lines = (folder / name).read_text().splitlines()
                return int(dict(line.split(maxsplit=1) for line in lines)["oom_kill"])
    return 0


def _folders(kind: str, root: Path, self_file: Path) -> Iterator[Path]:
    """Yield the folders of this process's cgroups for a kind of resource, the innermost first."""
    try:
        lines = self_file.read_text().splitlines()
    except OSError:
        return
    for line in lines:
        _, kinds, path = line.split(":", 2)
        home = root / kind if kinds else root
        if kinds and kind not in kinds.split(","):
            continue
        place = home / path.lstrip("/")
        for folder in (place, *place.parents):
            yield folder
            if folder == home:
                break
