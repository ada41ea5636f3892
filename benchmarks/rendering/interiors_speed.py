"""How long interiors take: drawing them, their truth, and their pictures.

python -m benchmarks.rendering.interiors_speed [scenes]
"""

import sys

from tabulate import tabulate

from benchmarks.timing import seconds_of
from scenegen.common.cgroup import processors
from scenegen.description.presets import preset_spec
from scenegen.objects.catalogue import objects_of
from scenegen.rendering.backend import point_to_llvm
from scenegen.rendering.packing import SceneBatch, pack_arrays
from scenegen.rendering.renderer import launch_fields, truth_fields
from scenegen.sampling.proposals import ProposalQueue

SIZES = 128, 512


def row(size: int, count: int) -> list[str]:
    """Return a row of the table."""
    from scenegen.rendering.pictures.tracer import trace_pictures

    spec = preset_spec("interiors", seed=5, height=size, width=size)
    objects = objects_of(spec)
    batches: list[SceneBatch] = []

    def draw() -> None:
        drawn = ProposalQueue(spec, range(count), objects).take(count, count)
        batches.append(pack_arrays(spec, drawn, (0,), objects))

    drawing = seconds_of(draw)
    first, batch = batches[0].rows(slice(0, 1)), batches[0]
    names = truth_fields(spec)
    found = [str(size), f"{drawing / count:.2f}"]
    for action in (
        lambda some: launch_fields(some, names)(),
        lambda some: trace_pictures(some, ("image", "exposure"), "llvm_ad_rgb"),
    ):
        action(first)  # compiles
        found.append(f"{seconds_of(lambda: action(batch)) / count:.2f}")  # noqa: B023
    return found


if __name__ == "__main__":
    point_to_llvm()
    scenes = int(sys.argv[1]) if len(sys.argv) > 1 else 16
    head = ["pixels", "drawing", "truth", "picture"]
    print(f"seconds a scene, {scenes} scenes, {processors()} processors, no denoiser\n")
    print(tabulate([row(size, scenes) for size in SIZES], head, "pipe", disable_numparse=True))
