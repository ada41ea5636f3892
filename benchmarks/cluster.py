"""What a cluster costs and brings: images a second by workers, and the scheduler's time a shard.

    python -m benchmarks.cluster [--n 8000] [--empty 10000]

Everything runs on this machine: with more workers than processors nothing gets faster.
"""

import argparse
import tempfile
import time
from functools import partial
from pathlib import Path

from tabulate import tabulate

from scenegen.common.cgroup import processors
from scenegen.description.specs import DatasetSpec
from scenegen.files.sets.cluster import LOCAL, connected
from scenegen.rendering.sameness import renderer_identity
from scenegen.rooms.make import make_dataset

SPEC = DatasetSpec(seed=1)


def of_processes(count: int, size: int, workers: int) -> float:
    """Return the images a second of worker processes, from their start."""
    with tempfile.TemporaryDirectory() as folder:
        start = time.perf_counter()
        make_dataset(Path(folder) / "rooms.h5", SPEC, count, shard_size=size, workers=workers)
        return count / (time.perf_counter() - start)


def of_cluster(count: int, size: int, workers: int) -> float:
    """Return the images a second of a cluster, once its workers are there."""
    identity = partial(renderer_identity, "auto")
    with tempfile.TemporaryDirectory() as folder, connected(LOCAL, workers, identity) as cluster:
        start = time.perf_counter()
        make_dataset(Path(folder) / "rooms.h5", SPEC, count, shard_size=size, cluster=cluster)
        return count / (time.perf_counter() - start)


def scheduling(count: int, workers: int) -> float:
    """Return the seconds that the scheduler takes for each of many calls that do nothing."""
    with connected(LOCAL, workers, partial(renderer_identity, "auto")) as cluster:
        start = time.perf_counter()
        calls = sum(1 for _ in cluster.results(abs, range(count)))
        return (time.perf_counter() - start) / calls


def main() -> None:
    """Measure, and print a table as Markdown."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--n", type=int, default=8000, help="rooms of 128x128 pixels")
    parser.add_argument("--empty", type=int, default=10_000, help="calls that do nothing")
    options = parser.parse_args()
    size = options.n // 16
    print(f"{options.n} rooms of 128x128, shards of {size}, {processors()} processors\n")
    of_processes(64, 64, 1)  # compiles the kernels
    rates = {f"--workers {n}": of_processes(options.n, size, n) for n in (1, 2)}
    rates |= {f"a cluster of {n}": of_cluster(options.n, size, n) for n in (1, 2, 4)}
    first = rates["--workers 1"]
    rows = [[name, f"{rate:.0f}", f"{rate / first:.2f}"] for name, rate in rates.items()]
    print(tabulate(rows, ["who renders", "images/s", "ratio"], "pipe", disable_numparse=True))
    print(f"\nscheduling with two workers: {1e3 * scheduling(options.empty, 2):.2f} ms a call")


if __name__ == "__main__":
    main()
