"""Write a rooms file."""

import hashlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
from numpy.typing import NDArray

from scenegen.layout import FORMAT_NAME, FORMAT_VERSION, columns
from scenegen.packing import SceneBatch
from scenegen.records import check
from scenegen.row_file import Table, new_file, writer_name
from scenegen.specs import DatasetSpec, SceneSpec

Array = NDArray[Any]
MAX_COUNT = 100_000_000
CONVENTIONS = (
    "world: right-handed, y up, room = unit box with floor y = 0 and walls x = 0, z = 0; camera:"
    " x right, y up, looks along -z; pixels: row 0 on top, centres at +0.5; see docs/conventions.md"
)


@dataclass(frozen=True, eq=False)
class RenderedRoom:
    """An accepted item: its scene, and its pixels as in `GroundTruth` without the batch axis."""

    scene: SceneSpec
    image: Array
    depth: Array
    normal: Array
    object_id: Array
    visible_pixels: Array


class RoomsWriter:
    """The rows of a rooms file in the making; `create_rooms` makes one."""

    def __init__(self, file: h5py.File, spec: DatasetSpec, count: int, compression: str) -> None:
        """Create the datasets."""
        self.table = Table(file, columns(spec), count, compression)
        self.digest = hashlib.sha256(spec.to_json().encode())

    def append(self, rooms: Sequence[RenderedRoom], batch: SceneBatch) -> None:
        """Write one row for each room, view 0; `batch` is their scenes, packed."""
        for i, room in enumerate(rooms):
            description = room.scene.to_json()
            self.digest.update(b"\n" + description.encode())
            self.table.append(
                {
                    "image": room.image,
                    "depth": room.depth,
                    "normal": room.normal,
                    "object_id": room.object_id,
                    "scene_index": room.scene.index,
                    "view_index": 0,
                    "camera/world_from_camera": batch.world_from_camera[i],
                    "camera/fov_y_degrees": batch.fov_y_degrees[i],
                    "light/count": batch.light_count[i],
                    "light/position": batch.light_position[i],
                    "light/color": batch.light_color[i],
                    "light/ambient": batch.ambient[i],
                    "light/attenuation": batch.attenuation[i],
                    "material/reflectance": batch.reflectance[i],
                    "object/count": batch.object_count[i],
                    "object/shape": batch.shape[i],
                    "object/world_from_object": batch.world_from_object[i],
                    "object/scale": batch.object_scale[i],
                    "object/visible_pixels": room.visible_pixels,
                    "scene": description,
                }
            )


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
    """Open a rooms file to write `count` rows; it gets its name when the block ends well.

    Its bytes depend on the rows alone, not on how they were handed over.

    Raises:
        SpecError: unknown compression, or a count below 1.
        OSError: the path, or the disk.
    """
    check(1 <= count <= MAX_COUNT, "n", count, f"from 1 to {MAX_COUNT:,} images")
    with new_file(path, overwrite) as file:
        file.attrs.update(
            {
                "format": FORMAT_NAME,
                "format_version": FORMAT_VERSION,
                "writer": writer_name(),
                "spec": spec.to_json(),
                "count": count,
                "compression": compression,
                "conventions": CONVENTIONS,
                **(attributes or {}),
            }
        )
        writer = RoomsWriter(file, spec, count, compression)
        yield writer
        if writer.table.rows != count:
            raise RuntimeError(f"{path}: got {writer.table.rows} of {count} rows")
        file.attrs["fingerprint"] = writer.digest.hexdigest()
