"""How fast questions are made, beside one Mitsuba render an image: one Markdown table.

    python -m benchmarks.rendering.questions [--quick]

Images have 128x128 pixels, colour only. Plain Mitsuba has its meshes and lights made beforehand,
writes no file and refuses no view; its light has no ambient part.
"""

import argparse
import shutil
import statistics
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from benchmarks.timing import Row, fastest, measured, print_ratio, print_table, processors_busy

PAPER_IMAGES = 1_200_000


def end_to_end(count: int, repeats: int, folder: str) -> dict[str, Any]:
    """Time make_split from nothing to closed files: all the images in one of them."""
    from iqtt.files.make import make_split
    from iqtt.questions.specs import SplitSpec
    from scenegen.rendering.renderer import useful_workers

    spec = SplitSpec(train=count, labeled=0, val=0, test=0)
    out = Path(tempfile.mkdtemp(dir=folder)) / "split"
    make_split(out, replace(spec, train=64))  # compiles the kernels
    seconds, busy = [], []
    for _ in range(repeats):
        shutil.rmtree(out)
        measured = processors_busy(partial(make_split, out, spec, workers=0))
        seconds.append(measured[0])
        busy.append(measured[1])
    used = useful_workers(4 * count, "llvm_ad_rgb")
    record = {"seconds": seconds, "images": 4 * count, "busy": statistics.median(busy)}
    return {**record, "workers": used, "note": f"{used} workers"}


def pixels(count: int, repeats: int, cubes: bool) -> dict[str, Any]:
    """Time pack, launch and fetch of colour and ids, by the cubes' kernel or the general one."""
    from iqtt.questions.distractors import make_pools
    from iqtt.questions.packing import pack_questions
    from iqtt.questions.specs import SplitSpec
    from iqtt.render import render_questions
    from scenegen.rendering.renderer import launch_fields

    spec = SplitSpec()
    made = render_questions(make_pools(spec), "train", 0, count)
    batch = pack_questions(spec, [item.question for items in made for item in items])
    batch = replace(batch, cubes_only=cubes)
    record = measured(lambda: launch_fields(batch, ("image", "object_id"))(), repeats)  # noqa: PLW0108
    return {**record, "images": 4 * count, "note": "one batch"}


def rows(folder: str, quick: bool) -> Iterator[Row]:
    """Yield the rows of the table."""
    few, repeats = (10, 2) if quick else (50, 3)
    for count in (1000,) if quick else (5000,):
        how = {"count": count, "repeats": repeats, "folder": folder}
        yield f"iqtt make-split, {count:,} questions", "rendering.questions:end_to_end", how
    for name, cubes in (("cubes'", True), ("general", False)):
        how = {"count": 64, "repeats": 10 * repeats, "cubes": cubes}
        yield f"pixels alone, the {name} kernel", "rendering.questions:pixels", how
    for variant in ("scalar_rgb", "llvm_ad_rgb"):
        how = {"count": few, "repeats": repeats, "variant": variant}
        yield f"plain Mitsuba, {variant}", "rendering.plain_mitsuba:questions", how


def main() -> None:
    """Print the table, and ratios of medians."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="measure fewer questions")
    quick = parser.parse_args().quick
    with tempfile.TemporaryDirectory(prefix="bench-") as folder:
        speeds = print_table("questions", rows(folder, quick), folder)
    ours, plain = fastest(speeds, "iqtt"), fastest(speeds, "plain")
    print_ratio("make-split / plain Mitsuba", ours, plain, 6)
    if ours:
        minutes = PAPER_IMAGES / ours.rate / 60
        print(f"- the paper's {PAPER_IMAGES:,} images at that rate: {minutes:.0f} minutes; goal 12")


if __name__ == "__main__":
    main()
