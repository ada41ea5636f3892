"""(b): scenegen's `make_dataset` end to end, its rendering stage alone, and the machine."""

import importlib.metadata
import statistics
import time
from functools import partial
from pathlib import Path
from typing import Any

from benchmarks.jobs.timing import STARTED, processors_busy, repeat


def machine() -> dict[str, Any]:
    """Return the versions and the variant, which only a process that renders can tell."""
    from scenegen.rendering.backend import select_variant, versions

    found = {name.removesuffix("_version"): text for name, text in versions().items()}
    found |= {name: importlib.metadata.version(name) for name in ("numpy", "h5py", "isal")}
    return {"versions": found, "variant": select_variant("auto")}


def end_to_end(rooms: str, count: int, repeats: int, workers: int = 0) -> dict[str, Any]:
    """Time make_dataset from nothing to a closed file; the last file stays.

    The process is warm: it has made a small file before. Worker processes start anew for each file.
    """
    from scenegen.description.specs import DatasetSpec
    from scenegen.rendering.renderer import useful_workers
    from scenegen.rooms.make import DEFAULT_BATCH, make_dataset

    def make(rows: int) -> tuple[float, float]:
        Path(rooms).unlink(missing_ok=True)  # so that no file's disk pages burden the next one
        how = {"workers": workers}
        return processors_busy(lambda: make_dataset(rooms, DatasetSpec(), rows, **how))

    make(DEFAULT_BATCH)
    first = time.perf_counter() - STARTED
    seconds, busy = zip(*(make(count) for _ in range(repeats)), strict=True)
    size = Path(rooms).stat().st_size / count / 1024
    used = workers or useful_workers(count, "llvm_ad_rgb")
    note = f"{used} workers, {statistics.median(busy):.2f} processors busy; {size:.0f} KiB a row"
    note += f"; first {DEFAULT_BATCH} rows {first:.1f} s after the process began"
    return {"seconds": seconds, "images": count, "note": note, "workers": used}


def from_nothing(
    rooms: str, count: int, preset: str, root: str = "", cache: str | None = None, **settings: Any
) -> dict[str, Any]:
    """Time make_dataset once, with no model in memory; imports and compilations come before.

    `cache` is the folder of models on disk, as earlier calls left it.
    """
    from benchmarks.jobs.inputs import read_scenes
    from scenegen.description.presets import preset_spec
    from scenegen.objects.sources import object_source
    from scenegen.rendering.renderer import useful_workers
    from scenegen.rooms.make import DEFAULT_BATCH, make_dataset

    object_source(preset, cache_dir=f"{rooms}-warm")
    warm = preset_spec(preset, seed=1, **settings)
    make_dataset(rooms, warm, DEFAULT_BATCH, overwrite=True)
    source = object_source(preset, objects_root=root or None, cache_dir=cache)
    spec = preset_spec(preset, **source.settings, **settings)
    how = {"objects": source.objects, "workers": 0, "overwrite": True}
    seconds, busy = processors_busy(partial(make_dataset, rooms, spec, count, **how))
    _, scenes = read_scenes(rooms, count)
    models = len({item.shape for scene in scenes for item in scene.objects})
    used = 1 if settings.get("shading") == "path" else useful_workers(count, "llvm_ad_rgb")
    note = f"{models:,} different models; {used} workers, {busy:.2f} processors busy"
    return {"seconds": [seconds], "images": count, "note": note, "workers": used}


def make_meshes(folder: str, count: int) -> dict[str, Any]:
    """Write bumpy balls of 20,480 faces as OBJ files, in three classes."""
    import numpy as np
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=5)
    for number in range(count):
        waves = np.random.default_rng(number).normal(size=(6, 3)) * 3
        bumps = 1 + 0.05 * np.sin(ball.vertices @ waves.T).sum(axis=1, keepdims=True)
        path = Path(folder) / f"class{number % 3}" / f"{number:03d}.obj"
        path.parent.mkdir(parents=True, exist_ok=True)
        trimesh.Trimesh(ball.vertices * bumps, ball.faces, process=False).export(path)
    return {"faces": len(ball.faces)}


def sampling(count: int, repeats: int) -> dict[str, Any]:
    """Take the processor time of proposing `count` scenes that all find room for their objects."""
    from scenegen.description.specs import DatasetSpec
    from scenegen.objects.catalogue import objects_of
    from scenegen.rooms.make import DEFAULT_BATCH
    from scenegen.sampling.proposals import ProposalQueue

    spec = DatasetSpec()

    def propose_all() -> None:
        queue = ProposalQueue(spec, range(count), objects_of(spec))
        while (scenes := queue.take(DEFAULT_BATCH, count)) is not None:
            for item in scenes.index.tolist():
                queue.accept(item)

    propose_all()
    seconds = []
    for _ in range(repeats):
        start = time.process_time()
        propose_all()
        seconds.append(time.process_time() - start)
    return {"seconds": seconds, "images": count, "note": "processor time, on one core"}


def stage(rooms: str, count: int, repeats: int, root: str = "") -> dict[str, Any]:
    """Time pack, launch and fetch of scenes that were proposed before, as arrays.

    As in make_dataset, a batch is packed while the one before is cast.
    """
    import numpy as np

    from scenegen.objects.sources import file_objects
    from scenegen.rendering.packing import SceneBatch, pack_arrays
    from scenegen.rendering.renderer import launch
    from scenegen.rooms.make import DEFAULT_BATCH
    from scenegen.rooms.reader import RoomsFile
    from scenegen.sampling.scenes import sample_scenes

    with RoomsFile(rooms) as file:
        spec = file.spec
    objects = file_objects(spec, objects_root=root or None)
    _, scenes = sample_scenes(spec, np.arange(2 * count), np.zeros(2 * count, int), objects)
    rows = np.arange(count)  # of these; a few proposals find no room
    parts = [scenes.take(rows[i : i + DEFAULT_BATCH]) for i in range(0, count, DEFAULT_BATCH)]

    def packed(part: Any) -> SceneBatch:
        return pack_arrays(spec, part, range(len(spec.views)), objects)

    def render_all() -> None:
        batch = packed(parts[0])
        for following in [*parts[1:], None]:
            fetch = launch(batch)
            if following is not None:
                batch = packed(following)
            fetch()

    note = f"batches of {DEFAULT_BATCH}; pack, launch, fetch"
    return {"seconds": repeat(render_all, repeats), "images": count, "note": note}
