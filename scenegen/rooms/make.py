"""Make files of rooms: render a data set to one file or to shards, or merge shards to one file."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from scenegen.common.records import check
from scenegen.description.specs import Request
from scenegen.files.new_file import check_writable
from scenegen.files.places import as_place
from scenegen.files.row_file import writer_name
from scenegen.files.sets.cluster import Cluster
from scenegen.files.sets.making import make_set
from scenegen.files.sets.plan import Mark, Part, Sheet, whole
from scenegen.files.sets.sets import merge_file
from scenegen.layout import (
    FORMAT_NAME,
    FORMAT_VERSION,
    SCORED,
    TRUTH_DIGEST,
    columns,
    conventions,
)
from scenegen.objects.catalogue import Objects, objects_of
from scenegen.objects.families.store import MEMBER_STORE
from scenegen.rendering.backend import select_variant, versions
from scenegen.rendering.pictures.places import ASSETS
from scenegen.rendering.renderer import useful_workers
from scenegen.rooms.reader import RoomsFile
from scenegen.rooms.render import RoomsWork

DEFAULT_BATCH = 64
MAX_BATCH = 4096
MAX_COUNT = 100_000_000  # scenes
MAX_RAYS = 2**28  # pixels of one batch; they take 8 GiB
MAX_WORKERS = 256
SHARD_SIZE = 10_000  # scenes


def make_dataset(
    path: str | Path,
    spec: Request,
    count: int,
    *,
    batch: int = DEFAULT_BATCH,
    workers: int = 1,
    shard_size: int = SHARD_SIZE,
    device: str = "auto",
    compression: str = "gzip",
    overwrite: bool = False,
    command: str = "",
    objects: Objects | None = None,
    cluster: Cluster | None = None,
    progress: Callable[[int], Any] = lambda done: None,
) -> None:
    """Render scenes 0 .. count - 1 of `spec` to a rooms file, each with a row for each view.

    Args:
        path: a file, or a URL such as `s3://bucket/rooms.h5`. Files for a URL are written on this
            machine, or on a worker of the cluster, and uploaded when complete.
        batch: images rendered at once; limits the memory and changes no byte of the file.
        workers: rendering processes; 0 for one per processor if that is faster. The number changes
            no byte of the file. Several processes need `objects` that can be pickled.
        shard_size: maximum number of scenes per file; more scenes are split into shards next to
            `path`, which reads as one file. The same call resumes an interrupted one.
        device, compression: as in `backend.DEVICES` and `table.COMPRESSIONS`.
        command: stored as the file's creation command.
        objects: source of the objects; None for `objects_of(spec)`.
        cluster: Dask cluster that makes the shards; `path` must then be a URL, or in a folder that
            all workers see.
        progress: called now and then with the number of rows written since the last call, first
            before anything is rendered.

    Raises SpecError for a setting out of range, BackendError where the device cannot render here,
    PlacementError where no scene meets the request, and others as `making.make_set`.
    """
    views = len(spec.view_angles)
    check_batch(batch, spec, views)
    check(0 <= workers <= MAX_WORKERS, "workers", workers, f"from 0 to {MAX_WORKERS}")
    check(1 <= count <= MAX_COUNT // views, "n", count, f"from 1 to {MAX_COUNT // views:,} scenes")
    variant = select_variant(device)
    objects = objects or objects_of(spec)
    place = as_place(path)
    check_writable(place, overwrite=True)
    renderer = {"variant": variant, **versions()}
    settings = {"format_version": FORMAT_VERSION, "writer": writer_name(), **renderer}
    attributes = {
        **settings, "format": FORMAT_NAME, "spec": spec.to_json(), "conventions": conventions(spec),
        "creation_command": command,
    }  # fmt: skip
    stored = {column.name for column in columns(spec)}
    scored = [name for name in SCORED if name in stored]
    marks = (Mark("fingerprint", ["scene"], request=spec.to_json()), Mark(TRUTH_DIGEST, scored))
    file = whole({place.name: attributes}, [rooms_part(spec, count, marks)])
    work = RoomsWork(spec, batch, device, objects, compression, MEMBER_STORE.folder,
                     (ASSETS.materials, ASSETS.environment))  # fmt: skip
    make_set(
        place.parent, [file], {**json.loads(spec.to_json()), **settings, "kind": FORMAT_NAME},
        work, shard_size,
        workers=workers or useful_workers(count * views, variant, work.worthwhile),
        cluster=cluster, overwrite=overwrite, progress=progress, note=objects.problems.update,
    )  # fmt: skip


def check_batch(batch: int, size: Any, views: int = 1, images: int = 1) -> None:
    """Raise SpecError for a batch of rows that has too many pixels.

    Args:
        size: has `height` and `width` of an image.
        views: rows that are rendered together, at least.
        images: of each row.
    """
    check(1 <= batch <= MAX_BATCH, "batch", batch, f"from 1 to {MAX_BATCH}")
    most = MAX_RAYS // (size.height * size.width * images)
    text = f"{batch}, with {views} views of a scene"
    what = "images" if images == 1 else f"rows of {images} images"
    check(max(batch, views) <= most, "batch", text, f"at most {most} {what} of this size")


def rooms_part(spec: Request, count: int, marks: tuple[Mark, ...] = ()) -> Part:
    """Return the rows of so many scenes."""
    return Part("", "", count, [Sheet(columns(spec))], marks, len(spec.view_angles), "scenes")


def merge_rooms(
    rooms: RoomsFile,
    out: str | Path,
    overwrite: bool = False,
    progress: Callable[[int], Any] = lambda done: None,
) -> None:
    """Write the rows of a file of rooms, or of a set of shards, to one file.

    Raises as `sets.merge_file`.
    """
    part = rooms_part(rooms.spec, len(rooms) // len(rooms.spec.view_angles))
    merge_file(rooms.opened, out, [part], rooms.compression(), overwrite, progress)
