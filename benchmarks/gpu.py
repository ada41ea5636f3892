"""Does a GPU draw what the CPU draws, and how fast: every preset of rooms, every kind of questions.

`python -m benchmarks.gpu [--quick] [--device cuda] [--page docs/gpu.md]`, from the repository's
root. It ends with an error where a goal of agreement is missed.
"""

import argparse
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from benchmarks.markdown import table
from iqtt.files.make import make_split
from iqtt.questions.specs import SUITE, SplitSpec
from scenegen.common.errors import BackendError
from scenegen.description.presets import PRESETS, preset_spec
from scenegen.description.specs import DatasetSpec
from scenegen.files.new_file import write_text
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


@dataclass(frozen=True)
class Set:
    """One request: what makes its file with a device, and where that file has what is compared.

    Attributes:
        make: (path, device) -> nothing; writes a file or a folder.
        file: of the pixels, relative to the path; empty where the path is the file.
        items, depth: names of the datasets that tell items apart and have the depths.
        ids: name of the dataset of object ids; empty where there is none.
        images: number of images made.
    """

    name: str
    make: Callable[[Path, str], Any]
    file: str
    items: str
    depth: str
    ids: str
    images: int


def sets(count: int) -> Iterator[Set]:
    """Yield every preset of rooms, and every kind of questions; each with `count` images or so."""
    for name in PRESETS:
        spec = preset_spec(name)
        scenes = max(1, count // len(spec.views))
        make = partial(_rooms, spec, scenes)
        images = scenes * len(spec.views)
        yield Set(f"rooms, `{name}`", make, "", "scene", "depth", "object_id", images)
    for kind, (distractors, answers) in SUITE.items():
        questions = max(1, count // (1 + answers))
        split = SplitSpec(distractors=distractors, answers=answers, with_depth=True)
        split = replace(split, train=0, labeled=0, val=questions, test=0)
        where = "iqtt-val.h5", "truth/world_from_shape", "truth/depth", ""
        images = questions * (1 + answers)
        yield Set(f"questions, `{kind}`", partial(_questions, split), *where, images)


def _rooms(spec: DatasetSpec, count: int, path: Path, device: str) -> None:
    make_dataset(path, spec, count, device=device)


def _questions(spec: SplitSpec, path: Path, device: str) -> None:
    make_split(path, spec, device=device)


@dataclass(frozen=True, eq=False)
class Made:
    """What a file has: bytes that tell items apart, depths, and ids.

    Without ids, whether there is a depth counts as one.
    """

    items: list[bytes]
    depth: Array
    ids: Array


def read(path: Path, one: Set) -> Made:
    """Read what is compared."""
    with h5py.File(path / one.file if one.file else path) as file:
        items = [np.asarray(value).tobytes() for value in file[one.items][:]]
        depth = file[one.depth][:]
        return Made(items, depth, file[one.ids][:] if one.ids else np.isfinite(depth))


def agreement(a: Made, b: Made) -> tuple[int, float, float]:
    """Return how many items are alike, and the shares of their pixels with equal ids and depths."""
    same = np.array([x == y for x, y in zip(a.items, b.items, strict=True)])
    if not same.any():
        return 0, 0.0, 0.0
    first, second = a.depth[same], b.depth[same]
    both = np.isfinite(first) & np.isfinite(second)
    near = np.abs(first[both] - second[both]) <= NEAR
    return int(same.sum()), float((a.ids[same] == b.ids[same]).mean()), float(near.mean())


def timed(make: Callable[[], Any]) -> tuple[float, float]:
    """Return seconds by the clock and of all cores."""
    start, used = time.perf_counter(), time.process_time()
    make()
    return time.perf_counter() - start, time.process_time() - used


def main() -> None:
    """Read the options, make every set on both devices, and write the page."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.gpu", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="fewer images")
    parser.add_argument("--device", default="cuda", help="beside the CPU [cuda]")
    parser.add_argument("--page", type=Path, help="where to write the page; else it is printed")
    given = parser.parse_args()
    try:
        variants = {name: select_variant(name) for name in (given.device, "cpu")}
    except BackendError as error:
        sys.exit(f"benchmarks.gpu: {error}")
    rows, missed = [], []
    for one in sets(64 if given.quick else 2_000):
        print(one.name, end=" ... ", file=sys.stderr, flush=True)
        made, seconds, used = {}, {}, {}
        with tempfile.TemporaryDirectory(prefix="bench-") as folder:
            for device in variants:
                one.make(Path(folder) / f"warm-{device}", device)
                out = Path(folder) / device
                seconds[device], used[device] = timed(partial(one.make, out, device))
                made[device] = read(out, one)
        alike, ids, depths = agreement(*made.values())
        count = len(made["cpu"].items)
        rate = {device: one.images / seconds[device] for device in variants}
        waits = max(0.0, 1 - used[given.device] / seconds[given.device])
        cells = [one.name, f"{alike:,} of {count:,}", f"{ids:.6f}", f"{depths:.6f}"]
        cells += [f"{rate[given.device]:,.0f}", f"{rate['cpu']:,.0f}"]
        cells += [f"{rate[given.device] / rate['cpu']:.1f}", f"{waits:.0%}"]
        rows.append(cells)
        print(", ".join(cells[1:]), file=sys.stderr)
        if ids < 1 or depths < GOAL:
            missed.append(one.name)
    text = f"# On a GPU\n\n`make bench-gpu` wrote this page: `{variants[given.device]}` beside"
    text += f" `{variants['cpu']}` on one machine.\n\n{table(HEAD, rows)}\n\n{NOTES}\n"
    if given.page:
        write_text(given.page, text, overwrite=True)
    else:
        print(text)
    if missed:
        sys.exit(f"the devices do not agree on {len(missed)} sets: {'; '.join(missed)}")


if __name__ == "__main__":
    main()
