"""Write a file of rooms, row by row."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from scenegen.common.records import check
from scenegen.description.scene_arrays import SceneArrays
from scenegen.description.specs import DatasetSpec, Fingerprint
from scenegen.files.content import seal
from scenegen.files.row_file import new_file, writer_name
from scenegen.files.schema import Column
from scenegen.files.shards import write_row_digests
from scenegen.files.table import PackedRows, Table, pack_rows
from scenegen.layout import (
    CONVENTIONS,
    FORMAT_NAME,
    FORMAT_VERSION,
    TRUTH_DIGEST,
    columns,
)
from scenegen.rendering.packing import SceneBatch
from scenegen.rooms.reader import truth_digest

Array = NDArray[Any]
MAX_COUNT = 100_000_000


@dataclass(frozen=True, eq=False)
class RenderedScene:
    """An accepted item with the pixels of its V views.

    Attributes:
        scenes, row: its description is a row of `scenes`.
        batch, first: where it is packed: its views are the images from `first` on.
        pixels: image, depth, normal and object_id of the views, (V, ...) as in `GroundTruth`.
        visible_pixels: how many pixels of each view show each object, (V, K).
    """

    scenes: SceneArrays
    row: int
    batch: SceneBatch
    first: int
    pixels: dict[str, Array]
    visible_pixels: Array

    @property
    def index(self) -> int:
        """The item's number in its data set."""
        return int(self.scenes.index[self.row])


class RoomsWriter:
    """Writes the rows of a new file of rooms; `create_rooms` makes one."""

    def __init__(
        self, file: h5py.File, spec: DatasetSpec, count: int, compression: str, is_shard: bool
    ) -> None:
        self.views = len(spec.views)
        self.table = Table(file, columns(spec), count * self.views, compression, is_shard)
        self.fingerprint = Fingerprint(spec)

    def append(self, rooms: Sequence[RenderedScene]) -> None:
        """Write a row for each view of each scene, at least one."""
        self.extend(pack_rooms(rooms, self.table.columns, self.table.compression))

    def extend(self, rows: PackedRows) -> None:
        """Write rows from `pack_rooms`."""
        for text in rows.others["scene"][:: self.views]:
            self.fingerprint.add(text.encode())
        self.table.extend_packed(rows)


def pack_rooms(
    rooms: Sequence[RenderedScene], columns: Sequence[Column], compression: str
) -> PackedRows:
    """Return a row for each view of each scene, at least one, packed to be written."""
    views = len(rooms[0].visible_pixels)
    rows: dict[str, Any] = _described(rooms, views)
    for name in rooms[0].pixels:
        rows[name] = [image for room in rooms for image in room.pixels[name]]
    rows["object/visible_pixels"] = np.concatenate([room.visible_pixels for room in rooms])
    rows["scene"] = [text for room in rooms for text in [room.scenes.to_json(room.row)] * views]
    return pack_rows(rows, columns, compression)


def _described(rooms: Sequence[RenderedScene], views: int) -> dict[str, Array]:
    """Return what the rows hold that their scenes say, by name of the dataset."""
    batches = {id(room.batch): room.batch for room in rooms}
    images: dict[int, list[int]] = {key: [] for key in batches}
    places: dict[int, list[int]] = {key: [] for key in batches}
    for place, room in enumerate(rooms):
        key = id(room.batch)
        images[key] += range(room.first, room.first + views)
        places[key] += range(place * views, (place + 1) * views)
    parts = [described(batch, np.array(images[key])) for key, batch in batches.items()]
    order = np.argsort([place for some in places.values() for place in some])
    return {name: np.concatenate([part[name] for part in parts])[order] for name in parts[0]}


def described(batch: SceneBatch, images: Array) -> dict[str, Array]:
    """Return what rows hold that their scenes say, by name of the dataset: n rows of each.

    `images` are the numbers of the rows' images in the batch, (n,).
    """
    spec = batch.spec
    models = np.array([*batch.names, ""], object)  # -1, an unused slot, takes the last
    classes = [spec.shapes.index(name.partition("/")[0]) for name in batch.names]
    shape, view = batch.shape[images], batch.view[images]
    return {
        "scene_index": batch.index[images],
        "view_index": view,
        "view_angle_degrees": np.array(spec.views)[view],
        "camera/world_from_camera": batch.world_from_camera[images],
        "camera/fov_y_degrees": batch.fov_y_degrees[images],
        "light/count": batch.light_count[images],
        "light/position": batch.light_position[images],
        "light/color": batch.light_color[images],
        "light/ambient": batch.ambient[images],
        "light/attenuation": batch.attenuation[images],
        "material/reflectance": batch.reflectance[images],
        "material/specular": batch.gloss[images, :, 0],
        "material/shininess": batch.gloss[images, :, 1],
        "object/count": batch.object_count[images],
        "object/shape": np.array([*classes, -1])[shape],
        "object/model": models[shape],
        "object/world_from_object": batch.world_from_object[images],
        "object/scale": batch.object_scale[images],
    }


def root_attributes(spec: DatasetSpec) -> dict[str, Any]:
    """Return the root attributes that a file of rooms has from the start."""
    return {
        "format": FORMAT_NAME,
        "format_version": FORMAT_VERSION,
        "writer": writer_name(),
        "spec": spec.to_json(),
        "conventions": CONVENTIONS,
    }


@contextmanager
def create_rooms(
    path: str | Path,
    spec: DatasetSpec,
    count: int,
    *,
    compression: str = "gzip",
    overwrite: bool = False,
    attributes: dict[str, str] | None = None,
    is_shard: bool = False,
) -> Iterator[RoomsWriter]:
    """Open a new file of rooms for `count` scenes; it gets its name when the block ends well.

    Its bytes depend on the rows alone, not on how many were appended at a time. Raises SpecError
    for an unknown compression or a count below 1, OSError where the file cannot be written.
    """
    rows = count * len(spec.views)
    most = MAX_COUNT // len(spec.views)
    check(1 <= count <= most, "n", count, f"from 1 to {most:,} scenes")
    with new_file(path, overwrite) as file:
        file.attrs.update(root_attributes(spec), **(attributes or {}))
        writer = RoomsWriter(file, spec, count, compression, is_shard)
        yield writer
        if writer.table.rows != rows:
            raise RuntimeError(f"{path}: got {writer.table.rows} of {rows} rows")
        if is_shard:
            write_row_digests(file, writer.table.row_digests())
        file.attrs["fingerprint"] = writer.fingerprint.hex
        file.attrs[TRUTH_DIGEST] = truth_digest(file)
        seal(file)
