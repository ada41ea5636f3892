"""How fast rooms are rendered, beside plain Mitsuba: Markdown tables.

    python -m benchmarks.rendering.render [--quick]

The first is of basic shapes, the second of the built-in objects, the third of a folder of meshes
of 20,480 faces, all at 128x128 pixels with depth and normals. (a) is plain Mitsuba, see
`plain_mitsuba`. MiB is the peak memory of the process and its workers.
"""

import argparse
import shutil
import statistics
import tempfile
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

from benchmarks.timing import Row, fastest, print_ratio, print_table, processors_busy

VARIANTS = ("llvm_ad_rgb", "scalar_rgb")


def end_to_end(
    rooms: str,
    count: int,
    repeats: int,
    preset: str = "shapes",
    workers: int = 0,
    cache: str | None = None,
    empty: bool = False,
    root: str | None = None,
    **settings: Any,
) -> dict[str, Any]:
    """Time make_dataset from nothing to a closed file; the last file stays.

    The process is warm: it has made a small file before. Worker processes start anew for each file.

    Args:
        cache: folder of models on disk, as earlier rows left it.
        empty: whether it is emptied before each file; the last one stays.
        root: folder of meshes, which are all cleaned before.
    """
    from scenegen.description.presets import preset_spec
    from scenegen.objects.sources import object_source
    from scenegen.rendering.renderer import useful_workers
    from scenegen.rooms.make import DEFAULT_BATCH, make_dataset

    cache = cache or f"{rooms}-cache"
    source = object_source(preset, objects_root=root, cache_dir=cache)
    spec = preset_spec(preset, **source.settings, **settings)
    if root and source.objects:
        for names in source.objects.models.values():
            for name in names:
                source.objects.shape(name)

    def make(rows: int, seed: int) -> tuple[float, float]:
        Path(rooms).unlink(missing_ok=True)  # so that no file's disk pages burden the next one
        if empty:
            shutil.rmtree(cache, ignore_errors=True)
        how = {"objects": source.objects, "workers": workers}
        seeded = preset_spec(preset, **source.settings, **settings, seed=seed)
        return processors_busy(partial(make_dataset, rooms, seeded, rows, **how))

    make(DEFAULT_BATCH, spec.seed + 1)
    seconds, busy = zip(*(make(count, spec.seed) for _ in range(repeats)), strict=True)
    used = workers or useful_workers(count, "llvm_ad_rgb")
    record = {"seconds": seconds, "images": count, "busy": statistics.median(busy)}
    return {**record, "workers": used, "note": f"{used} workers"}


def mesh_folder(root: Path, count: int) -> None:
    """Write meshes of 20,480 faces: balls with dents, of different lengths."""
    import numpy as np
    import trimesh

    (root / "pebble").mkdir(parents=True)
    ball = trimesh.creation.icosphere(subdivisions=5)
    for number in range(count):
        rng = np.random.default_rng(number)
        waves = np.sin(ball.vertices @ rng.normal(0, 3, (3, 6)) + rng.uniform(0, 6, 6)).sum(axis=1)
        points = ball.vertices * (1 + 0.06 * waves)[:, None] * rng.uniform(0.5, 1, 3)
        trimesh.Trimesh(points, ball.faces, process=False).export(root / f"pebble/{number}.ply")


def basic_shapes(folder: str, quick: bool) -> Iterator[Row]:
    """Yield the rows of basic shapes; the first makes the file whose scenes all others take."""
    rooms = f"{folder}/rooms.h5"
    first, second, largest = (500, 1000, 2000) if quick else (1000, 5000, 20000)
    few, repeats = (8, 2) if quick else (40, 3)
    whole = {"rooms": rooms, "repeats": repeats}
    yield f"(b) end to end, N = {first:,}", "rendering.render:end_to_end", {**whole, "count": first}
    plain = {"path": rooms, "count": few, "repeats": repeats}
    for variant in VARIANTS:
        yield f"(a) {variant}", "rendering.plain_mitsuba:rooms", {**plain, "variant": variant}
    name, how = f"(b) end to end, N = {second:,}", {**whole, "count": second}
    yield f"{name}, --workers 1", "rendering.render:end_to_end", {**how, "workers": 1}
    yield name, "rendering.render:end_to_end", how
    how = {**whole, "count": largest, "repeats": 1}
    yield f"(b) end to end, N = {largest:,}", "rendering.render:end_to_end", how
    traced = {"shading": "path", "height": 32, "width": 32, "spp": 16, "workers": 2}
    how = {"rooms": rooms, "count": first // 2, "repeats": repeats, **traced}
    yield "--shading path, 32 pixels, 16 samples", "rendering.render:end_to_end", how


def built_in_objects(folder: str, quick: bool) -> Iterator[Row]:
    """Yield the rows of built-in objects."""
    rooms = f"{folder}/objects.h5"
    count, largest, repeats = (500, 1000, 2) if quick else (5000, 20000, 3)
    # Two workers, as what one process keeps in memory would be neither empty nor on disk.
    whole = {"rooms": rooms, "preset": "shapenet", "cache": f"{folder}/cache", "workers": 2}
    name, how = f"(b) end to end, N = {count:,}", {**whole, "count": count, "repeats": repeats}
    yield f"{name}, empty cache", "rendering.render:end_to_end", {**how, "empty": True}
    yield f"{name}, warm cache", "rendering.render:end_to_end", how
    how = {**whole, "count": largest, "repeats": 1}
    yield f"(b) end to end, N = {largest:,}, warm cache", "rendering.render:end_to_end", how
    plain = {"path": rooms, "count": 8 if quick else 60, "repeats": repeats}
    for variant in VARIANTS:
        yield f"(a) {variant}", "rendering.plain_mitsuba:rooms", {**plain, "variant": variant}


def folder_of_meshes(folder: str, quick: bool) -> Iterator[Row]:
    """Yield the rows of a folder of meshes."""
    rooms, root = f"{folder}/meshes.h5", f"{folder}/models"
    count, models, repeats = (200, 10, 2) if quick else (2000, 100, 3)
    mesh_folder(Path(root), models)
    whole = {"rooms": rooms, "count": count, "repeats": repeats, "root": root}
    yield f"(b) end to end, N = {count:,}", "rendering.render:end_to_end", whole
    plain = {"path": rooms, "count": 8 if quick else 20, "repeats": repeats}
    for variant in VARIANTS:
        how = {**plain, "variant": variant, "objects_root": root}
        yield f"(a) {variant}", "rendering.plain_mitsuba:rooms", how


def main() -> None:
    """Print the tables, and ratios of medians beside their goals."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="measure fewer images")
    quick = parser.parse_args().quick
    with tempfile.TemporaryDirectory(prefix="bench-") as folder:
        shapes = print_table("basic shapes", basic_shapes(folder, quick), folder)
        whole = fastest(shapes, "(b) end to end")
        print_ratio("end to end / (a)", whole, fastest(shapes, "(a)"), 6)
        print()
        objects = print_table("built-in objects", built_in_objects(folder, quick), folder)
        plain = fastest(objects, "(a)")
        for cache, goal in (("warm", 9), ("empty", 5)):
            rows = {name: row for name, row in objects.items() if f"{cache} cache" in name}
            ours = fastest(rows, "(b)")
            print_ratio(f"end to end / (a), {cache} cache", ours, plain, goal)
            if cache == "warm":
                print_ratio("end to end / that of basic shapes", ours, whole, 0.75)
        print()
        meshes = print_table("folder of meshes", folder_of_meshes(folder, quick), folder)
        ratio = fastest(meshes, "(b)"), fastest(meshes, "(a)")
        print_ratio("end to end / (a)", *ratio, 20)


if __name__ == "__main__":
    main()
