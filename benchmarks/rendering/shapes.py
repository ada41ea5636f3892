"""CPU time to render each basic shape, as an exact surface and as a mesh: one Markdown table.

`python -m benchmarks.rendering.shapes [--quick]`, from the repository's root. Each row renders the
same scenes, with shadows off, 64 images at a time. The two ways take turns in one process, and CPU
time of all threads is counted, so that a busy machine does not favour either.
"""

import argparse
import statistics
import time
from dataclasses import replace
from functools import cache

from scenegen.description.scenes import SHAPE_NAMES
from scenegen.description.specs import DatasetSpec
from scenegen.objects.basic_shapes import unit_shape
from scenegen.objects.solids import UnitShape
from scenegen.rendering.packing import SceneBatch, pack
from scenegen.rendering.renderer import render
from scenegen.sampling.scenes import sample_scene

IMAGES = 64


@cache
def as_mesh(name: str) -> UnitShape:
    """Return a unit shape whose triangles are rendered."""
    return replace(unit_shape(name), surface=None)


def milliseconds(batch: SceneBatch) -> float:
    """Return the CPU time to render a batch, ms an image."""
    start = time.process_time()
    render(batch)
    return 1e3 * (time.process_time() - start) / len(batch)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="take fewer repeats")
    repeats = 3 if parser.parse_args().quick else 15
    print("| shape | exact, CPU-ms an image | mesh | mesh / exact |\n| --- | ---: | ---: | ---: |")
    for name in SHAPE_NAMES:
        spec = DatasetSpec(shapes=(name,))
        scenes = (sample_scene(spec, index) for index in range(4 * IMAGES))
        exact = pack(spec, [scene for scene in scenes if scene is not None][:IMAGES])
        ways = (exact, replace(exact, shape_of=as_mesh))
        spent = [[milliseconds(way) for way in ways] for _ in range(1 + repeats)][1:]
        ours, mesh = (statistics.median(times) for times in zip(*spent, strict=True))
        if unit_shape(name).surface is None:
            print(f"| {name} | - | {mesh:.2f} | |", flush=True)
        else:
            print(f"| {name} | {ours:.2f} | {mesh:.2f} | {mesh / ours:.2f} |", flush=True)


if __name__ == "__main__":
    main()
