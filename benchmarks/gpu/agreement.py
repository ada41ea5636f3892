"""Does a GPU draw what the CPU draws, and how fast: every preset of rooms, every kind of questions.

`python -m benchmarks.gpu.agreement [--images 2000] [--device cuda]` ends with an error where a goal
of agreement is missed.
"""

import argparse
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray
from tabulate import tabulate

from iqtt.files.make import make_split
from iqtt.questions.specs import SUITE, SplitSpec
from scenegen.common.errors import BackendError
from scenegen.description.presets import PRESETS, preset_spec
from scenegen.rendering.backend import select_variant
from scenegen.rooms.make import make_dataset

Array = NDArray[Any]
NEAR = 1e-4  # depth of two devices that count as one, in units of depth
GOAL = 0.999  # least share of the pixels with such a depth
HEAD = ("data", "items", "ids equal", "depths within 1e-4", "images/s", "CPU", "ratio")
HEAD += ("the process waits",)
NOTES = f"""One warm-up run of each, then one timed run, end to end to a closed file. `ids equal`
and `depths within 1e-4` are shares of the pixels of items that both devices accepted with the same
description (goals: 1, and {GOAL}). An item whose objects only just show enough pixels may be drawn
anew on one device alone; `items` counts those that both made alike. `the process waits` is the part
of the time in which its threads used less than a whole core: near 0, the host holds up the GPU."""


@dataclass(frozen=True, eq=False)
class Made:
    """What a file has: bytes that tell items apart, depths, and ids.

    Without ids, whether there is a depth counts as one.
    """

    items: list[bytes]
    depth: Array
    ids: Array


Make = Callable[[Path, str], Made]  # makes a file or folder at a path with a device, and reads it


def sets(count: int) -> Iterator[tuple[str, int, Make]]:
    """Yield name, number of images and function of each request, with `count` images or so."""
    for name in (name for name, it in PRESETS.items() if not it.settings.get("interior")):
        views = len(preset_spec(name).views)
        scenes = max(1, count // views)
        yield f"rooms, `{name}`", scenes * views, partial(_rooms, name, scenes)
    for kind, (distractors, answers) in SUITE.items():
        questions = max(1, count // (1 + answers))
        split = SplitSpec(
            distractors=distractors, answers=answers, with_depth=True,
            train=0, labeled=0, val=questions, test=0,
        )  # fmt: skip
        yield f"questions, `{kind}`", questions * (1 + answers), partial(_questions, split)


def _rooms(preset: str, count: int, path: Path, device: str) -> Made:
    make_dataset(path, preset_spec(preset), count, device=device)
    with h5py.File(path) as file:
        return Made([bytes(text) for text in file["scene"]], file["depth"][:], file["object_id"][:])


def _questions(spec: SplitSpec, path: Path, device: str) -> Made:
    make_split(path, spec, device=device)
    with h5py.File(path / "iqtt-val.h5") as file:
        depth = file["truth/depth"][:]
        poses = [pose.tobytes() for pose in file["truth/world_from_shape"]]
        return Made(poses, depth, np.isfinite(depth))


def agreement(a: Made, b: Made) -> tuple[int, float, float]:
    """Return how many items are alike, and the shares of their pixels with equal ids and depths."""
    same = np.array([x == y for x, y in zip(a.items, b.items, strict=True)])
    if not same.any():
        return 0, 0.0, 0.0
    first, second = a.depth[same], b.depth[same]
    both = np.isfinite(first) & np.isfinite(second)
    near = np.abs(first[both] - second[both]) <= NEAR
    return int(same.sum()), float((a.ids[same] == b.ids[same]).mean()), float(near.mean())


def main() -> None:
    """Read the options, make every set on both devices, and print the table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.gpu.agreement", description=__doc__)
    parser.add_argument("--images", type=int, default=2_000, help="of each set, or so  [2000]")
    parser.add_argument("--device", default="cuda", help="beside the CPU  [cuda]")
    options = parser.parse_args()
    device = options.device
    try:
        variants = {name: select_variant(name) for name in (device, "cpu")}
    except BackendError as error:
        sys.exit(f"benchmarks.gpu.agreement: {error}")
    print(f"`{variants[device]}` beside `{variants['cpu']}` on one machine.\n")
    missed = []
    for row, (name, images, make) in enumerate(sets(options.images)):
        made, rates, waits = {}, {}, {}
        with tempfile.TemporaryDirectory(prefix="bench-") as folder:
            for where in variants:
                make(Path(folder) / f"warm-{where}", where)
                start, used = time.perf_counter(), time.process_time()
                made[where] = make(Path(folder) / where, where)
                seconds = time.perf_counter() - start
                rates[where] = images / seconds
                waits[where] = max(0.0, 1 - (time.process_time() - used) / seconds)
        alike, ids, depths = agreement(made[device], made["cpu"])
        cells = [name, f"{alike:,} of {len(made['cpu'].items):,}", f"{ids:.6f}", f"{depths:.6f}"]
        cells += [f"{rates[device]:,.0f}", f"{rates['cpu']:,.0f}"]
        cells += [f"{rates[device] / rates['cpu']:.1f}", f"{waits[device]:.0%}"]
        # A line at a time: a run that is stopped leaves the rows before.
        lines = tabulate([cells], HEAD, "pipe", disable_numparse=True).splitlines()
        print("\n".join(lines[2 if row else 0 :]), flush=True)
        if ids < 1 or depths < GOAL:
            missed.append(name)
    print(f"\n{NOTES}")
    if missed:
        sys.exit(f"the devices do not agree on {len(missed)} sets: {'; '.join(missed)}")


if __name__ == "__main__":
    main()
