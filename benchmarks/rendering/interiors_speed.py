"""How long interiors take: drawing them, their truth, and their pictures.

    python -m benchmarks.rendering.interiors_speed [scenes]

The last column is Mitsuba's own path tracer with as many paths, on the same triangles in one grey
material, without lamps or the sampling of windows: what tracing costs that knows nothing of rooms.
"""

import sys
import time
from collections.abc import Callable
from typing import Any

from tabulate import tabulate

from scenegen.common.cgroup import processors
from scenegen.description.presets import preset_spec
from scenegen.objects.catalogue import objects_of
from scenegen.rendering.backend import point_to_llvm
from scenegen.rendering.packing import SceneBatch, pack_arrays
from scenegen.rendering.renderer import launch_fields, truth_fields
from scenegen.sampling.proposals import ProposalQueue

SIZES = 128, 512


def seconds(action: Callable[[], Any]) -> float:
    """Return the wall seconds of an action."""
    start = time.perf_counter()
    action()
    return time.perf_counter() - start


def plain(batch: SceneBatch) -> None:
    """Trace all images of a batch by Mitsuba's own path tracer."""
    import mitsuba as mi
    import numpy as np

    from benchmarks.rendering.plain_mitsuba import loaded
    from scenegen.common.records import from_json
    from scenegen.description.interiors import Interior
    from scenegen.rendering.pictures.matter import gather_matter
    from scenegen.rendering.pictures.sky import outside

    spec = batch.spec
    grey = mi.load_dict({"type": "twosided", "bsdf": {"type": "diffuse"}})
    paths = mi.load_dict({"type": "path", "max_depth": 12, "rr_depth": 3})  # as ours
    film = {
        "type": "hdrfilm",
        "width": spec.width,
        "height": spec.height,
        "rfilter": {"type": "box"},
    }
    for b in range(len(batch)):
        assert batch.interior is not None
        interior = from_json(Interior, batch.interior[b], "interior")
        soup = gather_matter(batch, b, lit=False).soup
        points, normals = soup.corners.reshape(-1, 3), soup.normals.reshape(-1, 3)
        # Mitsuba's cameras look along +z, with x to the left.
        view = mi.ScalarTransform4f(batch.world_from_camera[b] * np.array([-1.0, 1.0, -1.0, 1.0]))
        lens = {"fov": float(batch.fov_y_degrees[b]), "fov_axis": "y", "to_world": view}
        scene = mi.load_dict({
            "type": "scene",
            "sky": {"type": "envmap", "bitmap": mi.Bitmap(outside(interior).radiance)},
            "sensor": {"type": "perspective", **lens, "film": film},
            "room": loaded((points, normals, np.arange(len(points))), grey),
        })  # fmt: skip
        np.array(mi.render(scene, integrator=paths, spp=spec.spp))


def row(size: int, count: int) -> list[str]:
    """Return a row of the table."""
    from scenegen.rendering.pictures.tracer import trace_pictures

    spec = preset_spec("interiors", seed=5, height=size, width=size)
    objects = objects_of(spec)
    batches: list[SceneBatch] = []

    def draw() -> None:
        drawn = ProposalQueue(spec, range(count), objects).take(count, count)
        batches.append(pack_arrays(spec, drawn, (0,), objects))

    drawing = seconds(draw)
    first, batch = batches[0].rows(slice(0, 1)), batches[0]
    names = truth_fields(spec)
    found = [str(size), f"{drawing / count:.2f}"]
    for action in (
        lambda some: launch_fields(some, names)(),
        lambda some: trace_pictures(some, ("image", "exposure"), "llvm_ad_rgb"),
        plain,
    ):
        action(first)  # compiles
        found.append(f"{seconds(lambda: action(batch)) / count:.2f}")  # noqa: B023
    return found


if __name__ == "__main__":
    point_to_llvm()
    scenes = int(sys.argv[1]) if len(sys.argv) > 1 else 16
    head = ["pixels", "drawing", "truth", "picture", "Mitsuba's paths"]
    print(f"seconds a scene, {scenes} scenes, {processors()} processors, no denoiser\n")
    print(tabulate([row(size, scenes) for size in SIZES], head, "pipe", disable_numparse=True))
