"""What a cluster costs and brings: images/s by workers, the scheduler's time, and a model of more.

    python -m benchmarks.cluster [--n 8000] [--empty 10000]

Everything runs on this machine: with more workers than processors nothing gets faster. The model
takes the measured time of a shard on one processor, and the scheduler's time a shard, for clusters
that were not at hand.
"""

import argparse
import tempfile
import time
from collections.abc import Generator, Sequence
from functools import partial
from pathlib import Path

from scenegen.description.specs import DatasetSpec
from scenegen.files.cluster import LOCAL, Cluster, connected
from scenegen.files.making import Task, complete_set
from scenegen.files.manifest import FORMAT, Manifest, ShardRecord
from scenegen.files.workers import processors
from scenegen.rendering.sameness import renderer_identity
from scenegen.rooms.make import make_dataset

SPEC = DatasetSpec(seed=1)
MODELLED = (1_000_000, (1, 100, 1_000), (1_000, 10_000))  # images, workers, images of a shard


def render(count: int, size: int, workers: int, scheduler: bool) -> tuple[float, float]:
    """Return the seconds of a run once its workers are there, and its bytes an image."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "rooms.h5"
        if not scheduler:
            started = time.perf_counter()
            make_dataset(path, SPEC, count, shard_size=size, workers=workers)
            seconds = time.perf_counter() - started
        else:
            with connected(LOCAL, workers, partial(renderer_identity, "auto")) as cluster:
                started = time.perf_counter()
                make_dataset(path, SPEC, count, shard_size=size, cluster=cluster)
                seconds = time.perf_counter() - started
        return seconds, sum(file.stat().st_size for file in Path(folder).iterdir()) / count


def empty(task: Task) -> ShardRecord:
    """Return the record of a shard that was not made."""
    return ShardRecord(task.names[0], task.first, task.items, 1, 0, "0" * 64, "0" * 64, 0.0)


def scheduling(count: int, workers: int) -> float:
    """Return the seconds that a run of so many shards takes if they are not made."""
    tasks = [Task((f"rooms-{i:05d}-of-{count:05d}.h5",), i, 1) for i in range(count)]
    asked = Manifest(FORMAT, "", ("rooms.h5",), "{}", count, 1, (), "", False, ())
    with (
        tempfile.TemporaryDirectory() as folder,
        connected(LOCAL, workers, partial(renderer_identity, "auto")) as cluster,
    ):
        made = partial(_made_by, cluster)
        started = time.perf_counter()
        complete_set(Path(folder) / "rooms.manifest.json", asked, tasks, made, lambda _: None)
        return time.perf_counter() - started


def _made_by(cluster: Cluster, _: Manifest, tasks: Sequence[Task]) -> Generator[list[ShardRecord]]:
    for record in cluster.in_any_order(empty, tasks):
        yield [record]


def main() -> None:
    """Measure, and print tables as Markdown."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--n", type=int, default=8000)
    parser.add_argument("--empty", type=int, default=10_000)
    given = parser.parse_args()
    size = given.n // 16
    print(f"{given.n} rooms of 128x128, shards of {size}, {processors()} processors\n")
    print("| who renders | images/s | ratio |\n|---|---|---|")
    make_dataset(Path(tempfile.mkdtemp()) / "warm.h5", SPEC, 64)
    rates: dict[str, float] = {}
    for scheduler, workers in ((False, 1), (False, 2), (True, 1), (True, 2), (True, 4)):
        seconds, of_image = render(given.n, size, workers, scheduler)
        who = f"cluster of {workers}" if scheduler else f"--workers {workers}"
        rates[who] = given.n / seconds
        print(f"| {who} | {rates[who]:.0f} | {rates[who] / rates['--workers 1']:.2f} |", flush=True)
    idle = scheduling(given.empty, 2)
    cost = idle / given.empty
    print(f"\n{given.empty} empty shards, 2 workers: {idle:.1f} s, {1e3 * cost:.2f} ms a shard")
    one = rates["cluster of 1"]
    print(f"{of_image:.0f} bytes an image; one worker renders {one:.0f} images/s")
    images, workers_of, sizes = MODELLED
    print(
        f"\nModel: {images:,} images; the longer of rendering, by one processor a worker in whole"
    )
    print("shards, and of scheduling them one after another.\n")
    print("| workers | images a shard | shards | rendering, s | scheduling, s | images/s | GB/s |")
    print("|---|---|---|---|---|---|---|")
    for workers in workers_of:
        for of_shard in sizes:
            shards = images // of_shard
            rendering = -(-shards // workers) * of_shard / one
            seconds = max(rendering, shards * cost)
            speed = images / seconds
            print(
                f"| {workers} | {of_shard:,} | {shards:,} | {rendering:,.0f} | {shards * cost:.1f}"
                f" | {speed:,.0f} | {speed * of_image / 1e9:.2f} |"
            )


if __name__ == "__main__":
    main()
