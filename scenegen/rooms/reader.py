"""Read a file of rooms: typed records by index, and a map-style dataset for training loops."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from scenegen.camera import back_project, transform_points
from scenegen.common.errors import FileFormatError
from scenegen.common.records import check
from scenegen.description.scenes import SceneSpec
from scenegen.description.specs import DatasetSpec
from scenegen.files import input_file, row_file
from scenegen.files.attributes import check_attribute, read_digest, read_text, read_texts
from scenegen.files.content import SHA256, joint_digest
from scenegen.files.input_file import StoredArray
from scenegen.files.shards import JoinedArray, Shard, open_with_shards, stored_array
from scenegen.layout import (
    FIELDS,
    FORMAT_NAME,
    FORMAT_VERSION,
    SCORED,
    TRUTH_DIGEST,
    columns,
    has_digests,
    root_problems,
)
from scenegen.rendering.ground_truth import decode_image

Array = NDArray[Any]
NEEDED = ("format_version", "writer", "spec", "fingerprint")  # root attributes, beside the format


@dataclass(frozen=True, eq=False)
class Room:
    """One row of a rooms file; frames, units and shapes as in `layout.FIELDS`."""

    index: int
    view_index: int
    view_angle_degrees: float
    image: Array
    depth: Array
    normal: Array
    object_id: Array
    world_from_camera: Array
    fov_y_degrees: float
    scene: SceneSpec

    @property
    def radiance(self) -> Array:
        """Linear RGB radiance, (H, W, 3) float32."""
        return decode_image(self.image)

    @property
    def points(self) -> Array:
        """Surfel positions in the camera frame, (H, W, 3), scene units; NaN where nothing."""
        return back_project(self.depth, self.fov_y_degrees)

    @property
    def points_world(self) -> Array:
        """Surfel positions in the world frame, (H, W, 3), scene units; NaN where nothing."""
        return transform_points(self.world_from_camera, self.points)


def open_rooms(path: str | Path) -> "RoomsFile":
    """Open a rooms file for reading; raises as `RoomsFile` does."""
    return RoomsFile(path)


class RoomsFile:
    """An open rooms file: a sequence of `Room`s. Use it as a context manager, or close it.

    Attributes:
        spec: the request that it answers.
        fingerprint: SHA-256 of request and scenes (`specs.Fingerprint`).
        attributes: all root attributes.
    """

    def __init__(self, path: str | Path) -> None:
        """Open and check the layout. Raises OSError where there is no such file.

        Raises FileFormatError where it is not HDF5, not a file of rooms, of another major version,
        or damaged.
        """
        self.path = Path(path)
        self._file, self._shards = open_with_shards(self.path, "rooms file")
        with input_file.checking(self._file):
            self.attributes: dict[str, Any] = dict(self._file.attrs)
            self._check_format()
            texts = read_texts(self._file, NEEDED, self.path)
            self.spec = row_file.read_spec(self.path, texts, FORMAT_VERSION, DatasetSpec.from_json)
            mark = texts.get("fingerprint")
            check_attribute(path, "fingerprint", mark, mark is not None, "a text")
            self.fingerprint = texts["fingerprint"]
            problems = _layout_problems(self._file, self.spec)
            if problems:
                raise FileFormatError(f"{path}: {row_file.and_more(problems)}")
            self._datasets = {f.name: self._stored(self._file[f.name]) for f in FIELDS}
        self._count = len(self._datasets["image"])

    def _stored(self, dataset: h5py.Dataset) -> StoredArray | JoinedArray:
        return stored_array(dataset, self._shards)

    def _parts(self) -> Iterator[h5py.File]:
        """Yield the files that hold the values: this one, or its shards."""
        if self._shards is None:
            yield self._file
        else:
            yield from map(self._shards.file, range(len(self._shards.shards)))

    @property
    def parts(self) -> list[tuple[Path, int]]:
        """Path and number of rows of each file that holds values: this one, or its shards."""
        if self._shards is None:
            return [(self.path, len(self))]
        return [(self.path.parent / shard.file, shard.rows) for shard in self._shards.shards]

    @property
    def shards(self) -> tuple[Shard, ...]:
        """The shards of a set, in their order; none of a whole file."""
        return () if self._shards is None else tuple(self._shards.shards)

    def __len__(self) -> int:
        return self._count

    def __getitem__(self, index: int) -> Room:
        """Read one row; negative indices count from the end. Raises IndexError, FileFormatError."""
        return self.room(range(len(self))[index], self.read)

    def room(self, row: int, read: Callable[[str, int], Any]) -> Room:
        """Return one row, its values read by `read`, which is as this file's."""
        return Room(
            index=row,
            view_index=int(read("view_index", row)),
            view_angle_degrees=float(read("view_angle_degrees", row)),
            image=read("image", row),
            depth=read("depth", row),
            normal=read("normal", row),
            object_id=read("object_id", row),
            world_from_camera=read("camera/world_from_camera", row),
            fov_y_degrees=float(read("camera/fov_y_degrees", row)),
            scene=self._described(row, read("scene", row)),
        )

    def __iter__(self) -> Iterator[Room]:
        return (self[i] for i in range(len(self)))

    def scene(self, index: int) -> SceneSpec:
        """Return the description of the scene that row `index` shows."""
        return self._described(index, self.read("scene", index))

    def _described(self, row: int, text: bytes) -> SceneSpec:
        with row_file.describing(f"{self.path}: scene, row {row}"):
            return SceneSpec.from_json(text)

    def read(self, name: str, rows: int | slice) -> Any:
        """Read rows of one dataset. Raises FileFormatError where they are damaged."""
        with input_file.reading(f"{self.path}: {name}, row {rows}"):
            return self._datasets[name][rows]

    def problems(self) -> list[str]:
        """Return what is wrong with the layout and with the attributes of root and datasets."""
        with input_file.reading(self.path):
            problems = _layout_problems(self._file, self.spec) + root_problems(self.attributes)
            stored = next(self._parts())["image"].compression or "none"
            if stored != self.attributes.get("compression"):
                problems.append(f"root attribute compression is not {stored!r}, as of the images")
            return problems + _attribute_problems(self._file, self.spec)

    def content_problems(self, digests: Mapping[str, str]) -> list[str]:
        """Return what differs from the digests in the file, which must have them.

        `digests` are the `content.column_digest`s of datasets that were read already.
        """
        problems = row_file.digest_problems(self._file, digests, self._stored)
        with input_file.reading(self.path):
            if self.attributes.get(TRUTH_DIGEST) != truth_digest(self._file):
                problems.append(f"the digests of {', '.join(SCORED)} do not give {TRUTH_DIGEST!r}")
        return problems

    def stored_digests(self) -> dict[str, str]:
        """Return the digest that each dataset got when it was written; none in older files."""
        with input_file.reading(self.path):
            found = {
                name: read_digest(data, SHA256, f"{self.path}: {name}")
                for name, data in self._datasets.items()
            }
        return {name: digest for name, digest in found.items() if digest is not None}

    def stored_truth_digest(self) -> str | None:
        """Return what the file says of the datasets that scores depend on; None if older."""
        with input_file.reading(self.path):
            return read_digest(self._file, TRUTH_DIGEST, self.path)

    def stored_bytes(self) -> dict[str, tuple[int, int]]:
        """Return the bytes on disk and in memory of each dataset, by name.

        HDF5 does not tell the size of the heaps that hold texts. The dataset "scene" is said to
        take what all others leave of the file.
        """
        with input_file.reading(self.path):
            sizes, total = dict.fromkeys((f.name for f in FIELDS), 0), 0
            for file in self._parts():
                total += Path(file.filename).stat().st_size
                for name in sizes:
                    sizes[name] += file[name].id.get_storage_size()
            memory = {f.name: self._file[f.name].nbytes for f in FIELDS}
        texts = total - sum(sizes.values()) + sizes["scene"]
        sizes["scene"] = memory["scene"] = texts
        memory["object/model"] = sizes["object/model"]
        return {name: (sizes[name], memory[name]) for name in sizes}

    def close(self) -> None:
        """Close the file; idempotent."""
        self._file.close()
        if self._shards is not None:
            self._shards.close()

    def __enter__(self) -> "RoomsFile":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _check_format(self) -> None:
        found = read_text(self._file, "format", self.path)
        if found != FORMAT_NAME:
            raise FileFormatError(
                f"{self.path}: not a rooms file",
                "no format attribute" if found is None else f"format {found!r:.60}",
                f"{FORMAT_NAME!r}, as scenegen render writes it",
            )


def _layout_problems(file: h5py.File, spec: DatasetSpec) -> list[str]:
    """Return a sentence for each dataset that is missing or has the wrong shape or type."""
    image = file.get("image")
    count = image.shape[0] if isinstance(image, h5py.Dataset) and image.shape else 0
    problems = row_file.column_problems(file, columns(spec), count)
    told = file.attrs.get("count")
    if not problems and (count == 0 or not np.array_equal(count, told)):
        problems.append(
            f"found {count} rows, but the attribute 'count' is {told}, expected the same above 0"
        )
    return problems


def truth_digest(file: h5py.File) -> str:
    """Return the joint digest of the scored datasets, from their attributes `sha256`."""
    return joint_digest({name: str(file[name].attrs.get(SHA256)) for name in SCORED})


def _attribute_problems(file: h5py.File, spec: DatasetSpec) -> list[str]:
    """Return a sentence for each attribute of a dataset that is not as in `layout.columns`."""
    problems = []
    labels = has_digests(file.attrs)
    for column in columns(spec):
        attributes = dict(column.attributes)
        if labels:
            attributes["DIMENSION_LABELS"] = ["row", *(column.axes or ())]
        for name, expected in attributes.items():
            found = file[column.name].attrs.get(name)
            if found is None or not np.array_equal(np.asarray(found), np.asarray(expected)):
                problems.append(f"{column.name}: attribute {name} is {found!r:.60}")
    return problems


class RowBlock:
    """Some rows in a row of a file, each dataset read at once.

    Attributes:
        values: by name; without the datasets of which some of these rows are damaged.
    """

    def __init__(self, rooms: RoomsFile, rows: range) -> None:
        """Read the rows."""
        self.rows, self._file = rows, rooms
        self.values: dict[str, Sequence[Any]] = {}
        for field in FIELDS:
            with suppress(FileFormatError):
                if field.per_pixel:  # each row is a chunk
                    self.values[field.name] = [rooms.read(field.name, row) for row in rows]
                else:
                    every = slice(rows.start, rows.stop)
                    self.values[field.name] = rooms.read(field.name, every)

    def read(self, name: str, row: int) -> Any:
        """Return one row, perhaps of another block, as `RoomsFile.read`."""
        if name in self.values and row in self.rows:
            return self.values[name][row - self.rows.start]
        return self._file.read(name, row)


class RoomsDataset(row_file.RowDataset):
    """The rows of a rooms file as dicts of arrays, for any training loop; see `RowDataset`."""

    def __init__(
        self, path: str | Path, fields: Sequence[str] = ("image", "depth", "normal", "object_id")
    ) -> None:
        """Check the file once. Raises as `RoomsFile`, and SpecError for an unknown field."""
        known = [field.name for field in FIELDS if field.dtype != "text"]
        for name in fields:
            check(name in known, "field", repr(name), f"some of {', '.join(known)}")
        self.path = Path(path)
        with RoomsFile(path) as rooms:
            super().__init__(partial(RoomsFile, self.path), len(rooms), fields)
            self.spec, self.fingerprint = rooms.spec, rooms.fingerprint
