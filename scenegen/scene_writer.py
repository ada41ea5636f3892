"""Write a rooms file: rows in order, chunks compressed by us, renamed when complete."""

import errno
import hashlib
import importlib.metadata
import os
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any

import h5py
import numpy as np
from isal import isal_zlib
from numpy.typing import NDArray

from scenegen.errors import SpecError
from scenegen.layout import (
    FIELDS,
    FORMAT_NAME,
    FORMAT_VERSION,
    Field,
    image_scale,
    numpy_dtype,
    row_shape,
)
from scenegen.packing import SceneBatch
from scenegen.specs import DatasetSpec, SceneSpec

Array = NDArray[Any]
COMPRESSIONS = ("gzip", "lzf", "none")
DEFLATE_LEVEL = 1
BLOCK_ROWS = 1024  # rows of the small datasets that are kept and written together


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
    """A rooms file in the making; use it as a context manager.

    The file carries a temporary name until it is left without an error. It must have got all its
    rows by then. Its bytes depend on the rows alone, not on how they were handed over.
    """

    def __init__(
        self,
        path: str | Path,
        spec: DatasetSpec,
        count: int,
        *,
        compression: str = "gzip",
        overwrite: bool = False,
        attributes: dict[str, str] | None = None,
    ) -> None:
        """Create the temporary file.

        Raises:
            SpecError: unknown compression, or a count below 1.
            FileExistsError, FileNotFoundError, PermissionError, IsADirectoryError: the path.
        """
        if compression not in COMPRESSIONS:
            raise SpecError(
                f"compression: found {compression!r}, expected one of {', '.join(COMPRESSIONS)}"
            )
        if count < 1:
            raise SpecError(f"count: found {count}, expected at least 1")
        self.path = Path(path)
        check_writable(self.path, overwrite)
        self.spec, self.count, self.overwrite = spec, count, overwrite
        self._compression = compression
        self._rows = 0
        self._datasets: dict[str, h5py.Dataset] = {}
        self._digest = hashlib.sha256(spec.to_json().encode())
        self._blocks: dict[str, list[Any]] = {f.name: [] for f in FIELDS if not f.per_pixel}
        self._temporary = self.path.with_name(f".{self.path.name}.{os.getpid()}.partial")
        self._file = h5py.File(self._temporary, "w")
        try:
            self._create(attributes or {})
        except BaseException:
            self._abandon()
            raise

    def append(self, rooms: Sequence[RenderedRoom], batch: SceneBatch) -> None:
        """Write one row for each room, view 0; `batch` is their scenes, packed."""
        descriptions = [room.scene.to_json() for room in rooms]
        small: dict[str, Any] = {
            "scene_index": np.array([room.scene.index for room in rooms]),
            "view_index": np.zeros(len(rooms), np.int32),
            "camera/world_from_camera": batch.world_from_camera,
            "camera/fov_y_degrees": batch.fov_y_degrees,
            "light/count": batch.light_count,
            "light/position": batch.light_position,
            "light/color": batch.light_color,
            "light/ambient": batch.ambient,
            "light/attenuation": batch.attenuation,
            "material/reflectance": batch.reflectance,
            "object/count": batch.object_count,
            "object/shape": batch.shape,
            "object/world_from_object": batch.world_from_object,
            "object/scale": batch.object_scale,
            "object/visible_pixels": [room.visible_pixels for room in rooms],
            "scene": descriptions,
        }
        for i, room in enumerate(rooms):
            for name in ("image", "depth", "normal", "object_id"):
                self._write_chunk(name, self._rows, getattr(room, name))
            for name, rows in small.items():
                self._blocks[name].append(rows[i])
            self._digest.update(b"\n" + descriptions[i].encode())
            self._rows += 1
            if self._rows % BLOCK_ROWS == 0 or self._rows == self.count:
                self._flush_block()

    def __enter__(self) -> "RoomsWriter":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if kind is not None:
            self._abandon()
            return
        try:
            if self._rows != self.count:
                raise RuntimeError(f"{self.path}: got {self._rows} of {self.count} rows")
            self._file.attrs["fingerprint"] = self._digest.hexdigest()
            self._datasets.clear()
            self._file.close()
            check_writable(self.path, self.overwrite)
            os.replace(self._temporary, self.path)
        except BaseException:
            self._abandon()
            raise

    def _create(self, attributes: dict[str, str]) -> None:
        version = importlib.metadata.version("pix2shape-bench")
        self._file.attrs.update(
            {
                "format": FORMAT_NAME,
                "format_version": FORMAT_VERSION,
                "writer": f"pix2shape-bench {version}",
                "spec": self.spec.to_json(),
                "count": self.count,
                "conventions": "world: right-handed, y up, room = unit box with floor y = 0 and"
                " walls x = 0, z = 0; camera: x right, y up, looks along -z; pixels: row 0 on top,"
                " centres at +0.5; see docs/conventions.md",
                **attributes,
            }
        )
        for field in FIELDS:
            dataset = self._create_dataset(field)
            self._datasets[field.name] = dataset
            dataset.attrs["unit"] = field.unit
            dataset.attrs["frame"] = field.frame
            dataset.attrs["shape"] = "(" + ", ".join(["N", *map(str, field.shape)]) + ")"
            dataset.attrs["meaning"] = field.meaning
        self._file["image"].attrs["scale"] = image_scale(self.spec)
        self._file["object/shape"].attrs["names"] = list(self.spec.shapes)

    def _create_dataset(self, field: Field) -> h5py.Dataset:
        rows = row_shape(field, self.spec)
        dtype = h5py.string_dtype() if field.dtype == "text" else numpy_dtype(field, self.spec)
        chunk = 1 if field.per_pixel else min(self.count, BLOCK_ROWS)
        options: dict[str, Any] = {}
        if field.per_pixel and self._compression != "none":
            options["compression"] = self._compression
            options["shuffle"] = np.dtype(dtype).itemsize > 1
            if self._compression == "gzip":
                options["compression_opts"] = DEFLATE_LEVEL
        return self._file.create_dataset(
            field.name, (self.count, *rows), dtype, chunks=(chunk, *rows), **options
        )

    def _write_chunk(self, name: str, row: int, values: Array) -> None:
        dataset = self._datasets[name]
        if self._compression == "lzf":
            dataset[row] = values
            return
        raw = np.ascontiguousarray(values)
        if self._compression == "gzip":
            payload = isal_zlib.compress(shuffle_bytes(raw), DEFLATE_LEVEL)
        else:
            payload = raw.tobytes()
        dataset.id.write_direct_chunk((row, *(0 for _ in values.shape)), payload)

    def _flush_block(self) -> None:
        for name, rows in self._blocks.items():
            if rows:
                self._datasets[name][self._rows - len(rows) : self._rows] = (
                    rows if name == "scene" else np.stack(rows)
                )
                rows.clear()

    def _abandon(self) -> None:
        with suppress(Exception):
            self._file.close()
        self._temporary.unlink(missing_ok=True)


def shuffle_bytes(values: Array) -> Array:
    """Do HDF5's shuffle filter: all first bytes of the elements, then all second ones, ..."""
    size = values.dtype.itemsize
    flat = values.reshape(-1).view(np.uint8)
    return flat if size == 1 else np.ascontiguousarray(flat.reshape(-1, size).T)


def check_writable(path: Path, overwrite: bool) -> None:
    """Raise the OSError that would end in a lost run: better before rendering than after."""
    parent = path.parent
    if not parent.exists():
        raise FileNotFoundError(
            errno.ENOENT, "the folder does not exist; create it first", str(parent)
        )
    if not parent.is_dir():
        raise NotADirectoryError(errno.ENOTDIR, "is not a folder", str(parent))
    if path.is_dir():
        raise IsADirectoryError(errno.EISDIR, "is a folder; name a file in it", str(path))
    if path.exists() and not overwrite:
        raise FileExistsError(
            errno.EEXIST, "exists already; say --overwrite to replace it", str(path)
        )
    if not os.access(parent, os.W_OK):
        raise PermissionError(errno.EACCES, "cannot be written to", str(parent))
