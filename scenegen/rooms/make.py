"""Render a data set to a file of rooms, or to a set of shards that can be read as one file."""

from collections.abc import Callable
from contextlib import closing, suppress
from pathlib import Path
from typing import Any

from scenegen.common.records import check
from scenegen.description.specs import DatasetSpec
from scenegen.files.cluster import Cluster
from scenegen.files.making import refuse_other_set, remove_set
from scenegen.files.manifest import manifest_path
from scenegen.files.new_file import check_writable
from scenegen.files.places import as_place, check_store, is_remote
from scenegen.files.shards import MOST_SHARDS
from scenegen.objects.catalogue import Objects, objects_of
from scenegen.objects.families.store import MEMBER_STORE
from scenegen.rendering.backend import select_variant, versions
from scenegen.rendering.renderer import useful_workers
from scenegen.rooms.render import Work
from scenegen.rooms.shards import make_shards
from scenegen.rooms.writer import MAX_COUNT, create_rooms

DEFAULT_BATCH = 64
MAX_BATCH = 4096
MAX_RAYS = 2**28  # pixels of one batch; they take 8 GiB
MAX_WORKERS = 256
SHARD_SIZE = 10_000  # scenes


def make_dataset(
    path: str | Path,
    spec: DatasetSpec,
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
        path: a file, or a URL such as `s3://bucket/rooms.h5`: what goes there is written on this
            machine, or on a worker of the cluster, and uploaded when it is complete.
        batch: images rendered at once; it bounds memory and changes no byte of the file.
        workers: processes that render; 0 for one a processor where that is worth while. They
            change no byte either. More than one need a script whose own work is inside
            `if __name__ == "__main__":`, and `objects` that can be pickled.
        shard_size: if there are more scenes, they go to shards of so many beside `path`, which then
            shows all of them as one (`shards.make_shards`). The same call goes on where an earlier
            one was killed.
        device, compression: as in `backend.DEVICES` and `table.COMPRESSIONS`.
        command: stored as the file's creation command.
        objects: what the scenes are made of; None for `objects_of(spec)`.
        cluster: whose workers make the shards; `path` must then be in a folder that all of them
            see, or a URL.
        progress: called now and then with the number of rows written since the last call.

    Raises SpecError for a setting out of range, BackendError where the device cannot render here,
    PlacementError where no scene meets the request, and OSError where the disk refuses.
    """
    check(1 <= batch <= MAX_BATCH, "batch", batch, f"from 1 to {MAX_BATCH}")
    check(0 <= workers <= MAX_WORKERS, "workers", workers, f"from 0 to {MAX_WORKERS}")
    most = MAX_RAYS // (spec.height * spec.width)
    found = f"{batch}, with {len(spec.views)} views of a scene"
    enough = max(batch, len(spec.views)) <= most
    check(enough, "batch", found, f"at most {most} images of this size")
    least = max(1, -(-count // MOST_SHARDS))
    check(1 <= count <= MAX_COUNT, "n", count, f"from 1 to {MAX_COUNT:,} scenes")
    check(least <= shard_size, "shard-size", shard_size, f"at least {least} for so many scenes")
    variant = select_variant(device)
    objects = objects or objects_of(spec)
    workers = workers or useful_workers(count * len(spec.views), variant)
    attributes = {"creation_command": command, "variant": variant, **versions()}
    work = Work(spec, batch, workers, device, objects, compression, MEMBER_STORE.folder)
    place = as_place(path)
    if count > shard_size or cluster:
        make_shards(
            place, work, count, shard_size, attributes,
            cluster=cluster, overwrite=overwrite, progress=progress,
        )  # fmt: skip
        return
    if is_remote(place):
        check_store(place)
    check_writable(place, overwrite)
    manifest, begun = manifest_path(place), False
    with suppress(OSError):  # a name that is too long; then there is no set
        begun = manifest.exists()
    if begun and overwrite:
        refuse_other_set(manifest, (place.name,))
    elif begun:
        check_writable(manifest, overwrite=False)
    with (
        create_rooms(
            place,
            work.spec,
            count,
            compression=work.compression,
            overwrite=overwrite,
            attributes=attributes,
        ) as writer,
        closing(work.in_order([range(count)])) as made,
    ):
        for rows in made:
            writer.extend(rows)
            progress(rows.count)
    if begun:
        remove_set(manifest, place.name)
