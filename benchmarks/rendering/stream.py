"""Streams beside files of the same rows, once both are running: a Markdown table and ratios.

    python -m benchmarks.rendering.stream [--quick]

Images have 128x128 pixels, with depth and normals; questions have four images each, colour only.
To leave the start out, each row is the difference between a run of 3 N rows and one of N.
"""

import argparse
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from benchmarks.timing import Row, Speed, print_ratio, print_table, processors_busy


def running(what: str, preset: str, count: int, workers: int, folder: str) -> dict[str, Any]:
    """Time the rows N to 3 N of a stream or a file of rooms or questions; `what` says which."""
    from iqtt import QuestionStream, SplitSpec, make_split
    from scenegen import RoomStream, make_dataset
    from scenegen.description.presets import preset_spec
    from scenegen.objects.sources import object_source

    object_source(preset, cache_dir=f"{folder}/cache")

    def make(rows: int) -> None:
        how: dict[str, Any] = {"workers": workers, "overwrite": True}
        if what == "rooms file":
            make_dataset(f"{folder}/rooms.h5", preset_spec(preset), rows, **how)
        elif what == "questions file":
            spec = SplitSpec(distractors=preset, train=rows, labeled=0, val=0, test=0)
            make_split(f"{folder}/split", spec, **how)
        else:
            stream = RoomStream if what == "rooms stream" else QuestionStream
            for _ in stream(preset, batch=64, stop=rows, workers=workers):
                pass

    make(3 * count)  # fills the caches
    few, few_busy = processors_busy(lambda: make(count))
    many, many_busy = processors_busy(lambda: make(3 * count))
    seconds = many - few
    images = 2 * count * (4 if "questions" in what else 1)
    busy = (many * many_busy - few * few_busy) / seconds
    return {"seconds": [seconds], "images": images, "busy": busy, "workers": workers}


def rows(folder: str, quick: bool) -> Iterator[Row]:
    """Yield the rows of the table."""
    for what, preset, count in (
        ("rooms file", "shapes", 10_000),
        ("rooms stream", "shapes", 10_000),
        ("rooms file", "shapenet", 4_000),
        ("rooms stream", "shapenet", 4_000),
        ("questions file", "mixed", 2_000),
        ("questions stream", "mixed", 2_000),
    ):
        how = {"what": what, "preset": preset, "count": count // (5 if quick else 1)}
        yield (
            f"{what}, {preset}",
            "rendering.stream:running",
            {**how, "workers": 2, "folder": folder},
        )


def main() -> None:
    """Print the table, and ratios beside their goals."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="measure fewer rows")
    quick = parser.parse_args().quick
    with tempfile.TemporaryDirectory(prefix="bench-") as folder:
        Path(folder, "cache").mkdir()
        speeds = print_table("once running, 2 workers", rows(folder, quick), folder)
    named: dict[str, Speed | None] = dict.fromkeys(name for name, *_ in rows("", quick))
    named |= speeds
    goals = {"rooms {}, shapes": 1.8, "rooms {}, shapenet": 1.3, "questions {}, mixed": 1.3}
    for what, goal in goals.items():
        stream, file = (named[what.format(kind)] for kind in ("stream", "file"))
        print_ratio(what.format("stream / file"), stream, file, goal)


if __name__ == "__main__":
    main()
