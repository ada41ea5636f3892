"""Write a file of rooms, row by row."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
from numpy.typing import NDArray

from scenegen.common.hdf5.content import seal
from scenegen.common.hdf5.row_file import Table, new_file, writer_name
from scenegen.common.records import check
from scenegen.description.scene_arrays import SceneArrays
from scenegen.description.specs import DatasetSpec, Fingerprint
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

    def __init__(self, file: h5py.File, spec: DatasetSpec, count: int, compression: str) -> None:
        self.views = range(len(spec.views))
        self.table = Table(file, columns(spec), count * len(spec.views), compression)
        self.fingerprint = Fingerprint(spec)

    def append(self, rooms: Sequence[RenderedScene]) -> None:
        """Write a row for each view of each scene."""
        for room in rooms:
            description = room.scenes.to_json(room.row)
            self.fingerprint.add(description.encode())
            for view in self.views:
                row = {name: values[view] for name, values in room.pixels.items()}
                row |= described(room.batch, room.first + view)
                row |= {"object/visible_pixels": room.visible_pixels[view], "scene": description}
                self.table.append(row)


def described(batch: SceneBatch, i: int) -> dict[str, Any]:
    """Return what the row of image `i` holds that its scene says, by name of the dataset."""
    spec, view = batch.spec, int(batch.view[i])
    models = [batch.names[k] if k >= 0 else "" for k in batch.shape[i].tolist()]
    classes = [name.partition("/")[0] for name in models]
    return {
        "scene_index": batch.index[i],
        "view_index": view,
        "view_angle_degrees": spec.views[view],
        "camera/world_from_camera": batch.world_from_camera[i],
        "camera/fov_y_degrees": batch.fov_y_degrees[i],
        "light/count": batch.light_count[i],
        "light/position": batch.light_position[i],
        "light/color": batch.light_color[i],
        "light/ambient": batch.ambient[i],
        "light/attenuation": batch.attenuation[i],
        "material/reflectance": batch.reflectance[i],
        "material/specular": batch.gloss[i, :, 0],
        "material/shininess": batch.gloss[i, :, 1],
        "object/count": batch.object_count[i],
        "object/shape": [spec.shapes.index(name) if name else -1 for name in classes],
        "object/model": models,
        "object/world_from_object": batch.world_from_object[i],
        "object/scale": batch.object_scale[i],
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
) -> Iterator[RoomsWriter]:
    """Open a new file of rooms for `count` scenes; it gets its name when the block ends well.

    Its bytes depend on the rows alone, not on how many were appended at a time. Raises SpecError
    for an unknown compression or a count below 1, OSError where the file cannot be written.
    """
    rows = count * len(spec.views)
    most = MAX_COUNT // len(spec.views)
    check(1 <= count <= most, "n", count, f"from 1 to {most:,} scenes")
    with new_file(path, overwrite) as file:
        file.attrs.update(
            format=FORMAT_NAME,
            format_version=FORMAT_VERSION,
            writer=writer_name(),
            spec=spec.to_json(),
            count=rows,
            compression=compression,
            conventions=CONVENTIONS,
            **(attributes or {}),
        )
        writer = RoomsWriter(file, spec, count, compression)
        yield writer
        if writer.table.rows != rows:
            raise RuntimeError(f"{path}: got {writer.table.rows} of {rows} rows")
        file.attrs["fingerprint"] = writer.fingerprint.hex
        file.attrs[TRUTH_DIGEST] = truth_digest(file)
        seal(file)
