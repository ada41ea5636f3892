"""Where the processor time of an image goes: one Markdown table, a column for each preset.

    python -m benchmarks.rendering.stages [PRESET ...]

The stages of `rooms.render` run one after another, in batches of 64, on one thread. The models of
families are on disk before, and read from there.
"""

import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import h5py

from benchmarks.markdown import table
from scenegen.description.presets import preset_spec
from scenegen.description.scene_arrays import SceneArrays
from scenegen.files.content import row_digest
from scenegen.files.table import Table, deflated, shuffle_bytes
from scenegen.layout import columns
from scenegen.objects.catalogue import objects_of
from scenegen.objects.sources import object_source
from scenegen.rendering.packing import pack_arrays
from scenegen.rendering.renderer import launch, share_processors
from scenegen.rooms.make import DEFAULT_BATCH, make_dataset
from scenegen.rooms.pack import pack_rooms
from scenegen.rooms.render import _shown
from scenegen.sampling.proposals import ProposalQueue

T = TypeVar("T")
COUNT = 1024


def stages(preset: str, folder: str) -> Counter[str]:
    """Return the processor time of an image by stage, ms."""
    spec = preset_spec(preset, **object_source(preset, cache_dir=f"{folder}/cache").settings)
    make_dataset(f"{folder}/{preset}.h5", spec, COUNT, workers=2)
    share_processors(1_000_000)  # one thread
    objects, spent = objects_of(spec), Counter[str]()

    def timed(stage: str, action: Callable[[], T]) -> T:
        start = time.process_time()
        result = action()
        spent[stage] += 1e3 * (time.process_time() - start) / COUNT  # type: ignore[assignment]
        return result

    def batch(rows: Table, scenes: SceneArrays) -> None:
        packed = timed("pack", lambda: pack_arrays(spec, scenes, (0,), objects))
        fetch = timed("upload, cast, shade", lambda: launch(packed))
        truth = timed("fetch", fetch)
        rooms = timed(
            "count visible pixels",
            lambda: [
                room for room in _shown(scenes, packed, truth.pixels(), None, (), "auto") if room
            ],
        )
        done = timed("pack rows", lambda: pack_rooms(rooms, columns(spec), "gzip"))
        pixels = [values[0] for room in rooms for values in room.pixels.values()]
        timed("of which SHA-256", lambda: [row_digest(values) for values in pixels])
        timed("of which compress", lambda: [deflated(shuffle_bytes(values)) for values in pixels])
        timed("write", lambda: rows.extend_packed(done))

    def whole(rows: Table, count: int) -> None:
        queue = ProposalQueue(spec, range(count), objects)
        while (scenes := timed("propose", lambda: queue.take(DEFAULT_BATCH, count))) is not None:
            for item in scenes.index.tolist():
                queue.accept(item)
            batch(rows, scenes)

    with h5py.File(f"{folder}/rows.h5", "w") as file:
        for name, count in (("warm", DEFAULT_BATCH), (preset, COUNT)):
            spent.clear()
            whole(Table(file.create_group(name), columns(spec), count), count)
    spent["all"] = sum(t for name, t in spent.items() if not name.startswith("of which"))
    return spent


def main() -> None:
    """Print the table."""
    presets = sys.argv[1:] or ["shapes", "shapenet"]
    with tempfile.TemporaryDirectory(prefix="bench-") as folder:
        Path(folder, "cache").mkdir()
        spent = [stages(preset, folder) for preset in presets]
    cells = [[name, *(f"{times[name]:.2f}" for times in spent)] for name in spent[0]]
    print(table(["CPU-ms an image", *presets], cells))


if __name__ == "__main__":
    main()
