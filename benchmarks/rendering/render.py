"""How fast rooms are rendered, beside plain Mitsuba and the bare ray cast: Markdown tables.

    python -m benchmarks.rendering.render [--quick]

The first is of basic shapes, the second of the built-in objects, the third of a folder of meshes
of 20,480 faces, all at 128x128 pixels with depth and normals. (a) is plain Mitsuba, see
`plain_mitsuba`; (c) casts the same rays and evaluates nothing but the ray parameter and an id, so
it is an upper bound. MiB is the peak memory of the process and its workers.
"""

import argparse
import shutil
import statistics
import tempfile
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

from benchmarks.timing import Row, fastest, measured, print_ratio, print_table, processors_busy

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


def bare_cast(rooms: str, count: int, repeats: int, size: int) -> dict[str, Any]:
    """Time the nearest hits of the primary rays alone, in batches of a size.

    Every object is cast at its unit shape, in the structures of `scenegen.rendering`.
    """
    import drjit as dr
    import mitsuba as mi
    import numpy as np

    from scenegen.camera import pixel_size
    from scenegen.rendering.backend import select_variant
    from scenegen.rendering.drjit_renderer import upload_scenes
    from scenegen.rendering.packing import SceneBatch, pack
    from scenegen.rendering.rays import closest_hit
    from scenegen.rendering.tables import upload
    from scenegen.rooms.reader import RoomsFile

    variant = select_variant("cpu")
    mi.set_variant(variant)
    with RoomsFile(rooms) as file:
        spec, scenes = file.spec, [file.scene(row) for row in range(count)]
    batches = [pack(spec, scenes[i : i + size]) for i in range(0, count, size)]

    def cameras(batch: SceneBatch) -> Any:
        """Return 13 floats an image, padded to 16: 3x4 world_from_camera and the pixel size."""
        table = np.zeros((len(batch), 16), np.float32)
        table[:, :12] = batch.world_from_camera[:, :3].reshape(-1, 12)
        table[:, 12] = [pixel_size(spec.height, fov) for fov in batch.fov_y_degrees.tolist()]
        return upload(table)

    def cast(batch: SceneBatch, uploaded: Any, table: Any) -> None:
        pixels = spec.height * spec.width
        index = dr.arange(mi.UInt32, len(batch) * pixels)
        item = index // pixels
        pixel = index - item * pixels
        row = pixel // spec.width
        column = pixel - row * spec.width
        camera = [dr.gather(mi.Float, table, item * 16 + i) for i in range(13)]
        right, up, back, origin = (mi.Vector3f(*camera[i:12:4]) for i in range(4))
        x = (mi.Float(column) + 0.5 - spec.width / 2) * camera[12]
        y = (spec.height / 2 - 0.5 - mi.Float(row)) * camera[12]
        t, object_id, _, _ = closest_hit(uploaded, item, origin, right * x + up * y - back)
        dr.eval(t, object_id)

    ready = [(batch, upload_scenes(batch, variant, ())[0], cameras(batch)) for batch in batches]

    def cast_all() -> None:
        for arguments in ready:
            cast(*arguments)
        dr.sync_thread()

    return {**measured(cast_all, repeats), "images": count, "note": f"batches of {size}"}


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
    scenes, few, repeats = (256, 8, 2) if quick else (1000, 40, 3)
    whole = {"rooms": rooms, "repeats": repeats}
    yield f"(b) end to end, N = {first:,}", "rendering.render:end_to_end", {**whole, "count": first}
    shared = {"rooms": rooms, "count": scenes, "repeats": repeats}
    yield "(c) bare cast", "rendering.render:bare_cast", {**shared, "size": 256}
    plain = {"path": rooms, "count": few, "repeats": repeats}
    for coarse, meshes in ((False, "the same"), (True, "coarse")):
        for variant in VARIANTS:
            how = {**plain, "variant": variant, "coarse": coarse}
            yield f"(a) {meshes} meshes, {variant}", "rendering.plain_mitsuba:rooms", how
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
    plain = {"path": rooms, "count": 8 if quick else 60, "repeats": repeats, "coarse": False}
    for variant in VARIANTS:
        yield f"(a) {variant}", "rendering.plain_mitsuba:rooms", {**plain, "variant": variant}


def folder_of_meshes(folder: str, quick: bool) -> Iterator[Row]:
    """Yield the rows of a folder of meshes."""
    rooms, root = f"{folder}/meshes.h5", f"{folder}/models"
    count, models, repeats = (200, 10, 2) if quick else (2000, 100, 3)
    mesh_folder(Path(root), models)
    whole = {"rooms": rooms, "count": count, "repeats": repeats, "root": root}
    yield f"(b) end to end, N = {count:,}", "rendering.render:end_to_end", whole
    plain = {"path": rooms, "count": 8 if quick else 20, "repeats": repeats, "coarse": False}
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
        whole, cast = fastest(shapes, "(b) end to end"), fastest(shapes, "(c)")
        print_ratio("end to end / (a), the same meshes", whole, fastest(shapes, "(a) the same"), 6)
        print_ratio("end to end / (a), coarse meshes", whole, fastest(shapes, "(a) coarse"), 6)
        print_ratio("end to end / (c)", whole, cast, 0.3)
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
