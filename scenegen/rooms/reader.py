"""Read a file of rooms: typed records by index, and a map-style dataset for training loops."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, overload

import h5py
import numpy as np
from numpy.typing import NDArray

from scenegen.camera import Lens, back_project, transform_points
from scenegen.common.errors import FileFormatError
from scenegen.common.records import check
from scenegen.derived import seen_from
from scenegen.description.scenes import SceneSpec
from scenegen.description.specs import request_from_json
from scenegen.files.attributes import read_root
from scenegen.files.content import SHA256, joint_digest
from scenegen.files.input_file import describing
from scenegen.files.rows import RowDataset, RowFile, chosen_rows
from scenegen.files.sets.shards import OpenFile
from scenegen.layout import FORMAT, FURTHER, INTERIOR, LENS, SCORED, TRUTH_DIGEST, WITHHELD, columns
from scenegen.rendering.ground_truth import decode_image, undeveloped

Array = NDArray[Any]
# What a file without truth holds.
INPUT = (
    "image",
    "scene_index",
    "view_index",
    "view_angle_degrees",
    "camera/world_from_camera",
    "camera/fov_y_degrees",
)
WITHOUT_TRUTH = (*INPUT, *(column.name for column in LENS))  # the same, of crops, too


@dataclass(frozen=True, eq=False)
class Room:
    """One row of a rooms file; frames, units and shapes as in `layout.FIELDS`.

    `truth` has the columns of `layout.FURTHER` and `layout.INTERIOR` that the file holds, by name.
    """

    index: int
    view_index: int
    view_angle_degrees: float
    image: Array
    depth: Array
    normal: Array
    object_id: Array
    world_from_camera: Array
    lens: Lens
    scene: SceneSpec
    truth: Mapping[str, Array]

    @property
    def fov_y_degrees(self) -> float:
        """Vertical field of view, as `camera.Lens` has it."""
        return self.lens.fov_y_degrees

    @property
    def radiance(self) -> Array:
        """Linear RGB radiance, (H, W, 3) float32; of tone-mapped images, the displayed radiance."""
        return _linear(self.image, self.scene.interior is not None)

    @property
    def unit(self) -> str:
        """The unit of lengths: "metre" in closed rooms, else "scene unit"."""
        return "metre" if self.scene.interior is not None else "scene unit"

    @property
    def points(self) -> Array:
        """Surfel positions in the camera frame, (H, W, 3), scene units; NaN where nothing."""
        return back_project(self.depth, self.lens)

    @property
    def points_world(self) -> Array:
        """Surfel positions in the world frame, (H, W, 3), scene units; NaN where nothing."""
        return transform_points(self.world_from_camera, self.points)


@dataclass(frozen=True, eq=False)
class StereoPair:
    """Two images by cameras of the same orientation, of which the second is further to the right.

    `baseline` is the distance between the cameras, in the unit of the rooms.
    """

    left: Room
    right: Room
    baseline: float

    @property
    def focal(self) -> float:
        """The focal length, in widths of a pixel."""
        return float(1.0 / self.left.lens.grid(*self.left.depth.shape).across)

    @property
    def disparity(self) -> NDArray[np.float64]:
        """Disparity of the left and of the right image, (2, H, W), in pixels.

        The point at (x, y) of the left image is at (x - d, y) of the right image. NaN where nothing
        is hit.
        """
        depths = np.stack([self.left.depth, self.right.depth]).astype(float)
        return np.asarray(self.focal * self.baseline / depths)

    @property
    def visible(self) -> NDArray[np.bool_]:
        """Which pixels of each image show what the other image shows too, (2, H, W).

        As `derived.seen_from`, so it can be wrong within half a pixel of a silhouette.
        """
        pairs = (self.left, self.right), (self.right, self.left)
        return np.stack([
            seen_from(one.points_world, one.object_id, other.depth, other.normal, other.object_id,
                      other.world_from_camera, other.lens)
            for one, other in pairs
        ])  # fmt: skip


def radiance_of(rooms: Any, row: int) -> Array:
    """Return the linear RGB radiance of a row, as `Room.radiance`, of a file or of streamed rows.

    Raises FileFormatError where the row is damaged.
    """
    return _linear(rooms.read("image", row), rooms.spec.interior)


def _linear(image: Array, interior: bool) -> Array:
    developed = interior and image.dtype == np.uint8
    return undeveloped(image) if developed else decode_image(image)


def open_rooms(path: str | Path) -> "RoomsFile":
    """Open a rooms file for reading; raises as `RoomsFile` does."""
    return RoomsFile(path)


class RoomsFile(RowFile):
    """An open rooms file: a sequence of `Room`s. Use it as a context manager, or close it.

    Attributes, besides those of `RowFile`:
        spec: the request that the file was made from.
        fingerprint: recipe hash: SHA-256 of request and scenes (`content.fingerprint`).
        further: names of the columns of `layout.FURTHER` that it holds.
        has_truth: whether the file has ground truth, and not only INPUT; see `rooms.withheld`.
    """

    SCORED = SCORED

    def __init__(self, path: str | Path | OpenFile) -> None:
        """Open and check the layout, or take a file that is open.

        Raises OSError where there is no such file, and FileFormatError where it is not HDF5, not a
        file of rooms, of another major version, or damaged.
        """
        super().__init__(path if isinstance(path, OpenFile) else OpenFile(path, FORMAT.kind))

    def _open_columns(self) -> None:
        self.attributes = read_root(self.opened.file, self.path, FORMAT)
        self.fingerprint = self.attributes["fingerprint"]
        self.stored_truth_digest = self.attributes[TRUTH_DIGEST]
        with describing(f"{self.path}: attribute 'spec'"):
            self.spec = request_from_json(self.attributes["spec"])
        self.further = [c.name for name in self.spec.truth for c in FURTHER[name]]
        self.further += [c.name for c in INTERIOR if self.spec.interior]
        self._count_rows("image")
        if not len(self):
            raise FileFormatError(f"{self.path}: image", "no rows", "at least one")
        self.has_truth = WITHHELD not in self.attributes
        self._take("", [c for c in columns(self.spec) if self.has_truth or c.name in WITHOUT_TRUTH])

    @overload
    def __getitem__(self, index: int) -> Room: ...
    @overload
    def __getitem__(self, index: slice | Sequence[int] | Array) -> list[Room]: ...
    def __getitem__(self, index: Any) -> Room | list[Room]:
        """Read a row, or several by a slice or a list; negative numbers count from the end.

        Raises as `rows.chosen_rows`, and FileFormatError.
        """
        rows = chosen_rows(index, len(self))
        if isinstance(rows, int):
            return self.room(rows, self.read)
        return [self.room(row, self.read) for row in rows]

    def __iter__(self) -> Iterator[Room]:
        return (self[i] for i in range(len(self)))

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
            lens=self.spec.lens(float(read("camera/fov_y_degrees", row))),
            scene=self._described(row, read("scene", row)),
            truth={name: read(name, row) for name in self.further},
        )

    def lens(self, row: int) -> Lens:
        """Return the lens of a row. Raises FileFormatError where it is damaged."""
        return self.spec.lens(float(self.read("camera/fov_y_degrees", row)))

    def scene(self, index: int) -> SceneSpec:
        """Return the description of the scene that row `index` shows."""
        return self._described(index, self.read("scene", index))

    def _described(self, row: int, text: bytes) -> SceneSpec:
        with describing(f"{self.path}: scene, row {row}"):
            return SceneSpec.from_json(text)

    def room_size(self, row: int) -> Array | None:
        """Return the inner size of a closed room, (3,), metres; None for the paper's room."""
        return np.asarray(self.read("room/size", row)) if self.spec.interior else None

    def check_field(self, name: str) -> None:
        """Raise SpecError unless `read` takes this name, FileFormatError if it is held out."""
        if not self.has_truth and name in {c.name for c in columns(self.spec)} - {*WITHOUT_TRUTH}:
            beside = f"{self.path.stem}-truth{self.path.suffix}"
            hint = f"it is in the file with the ground truth, such as {beside}"
            raise FileFormatError(
                f"{self.path}: {name}",
                "rooms without ground truth",
                "a file with ground truth",
                hint,
            )
        super().check_field(name)

    def stereo(self, row: int) -> StereoPair:
        """Return the stereo pair that a row is part of. Raises SpecError where there are none."""
        expected = "stereo pairs (render --stereo)"
        check(self.spec.stereo > 0, str(self.path), "single images", expected)
        left, right = self[[row - row % 2, row - row % 2 + 1]]
        return StereoPair(left, right, self.spec.stereo)

    def reopener(self) -> Callable[[], "RoomsFile"]:
        """Return a function, which can be pickled, that opens the same rows again."""
        return partial(RoomsFile, self.path)


def truth_digest(file: h5py.File) -> str:
    """Return the joint digest of the scored datasets, from their attributes `sha256`."""
    scored = [name for name in SCORED if name in file]
    return joint_digest({name: str(file[name].attrs.get(SHA256)) for name in scored})


class RoomsDataset(RowDataset):
    """The rows of a rooms file as dicts of arrays, for any training loop; see `RowDataset`."""

    def __init__(
        self,
        rooms: str | Path | RoomsFile,
        fields: Sequence[str] = ("image", "depth", "normal", "object_id"),
    ) -> None:
        """Check the file once, or take one that is open.

        Raises as `RoomsFile`, and SpecError for an unknown field.
        """
        with nullcontext(rooms) if isinstance(rooms, RoomsFile) else RoomsFile(rooms) as file:
            numeric = [column.name for column in columns(file.spec) if column.dtype != "text"]
            for name in fields:
                check(name in numeric, "field", repr(name), f"some of {', '.join(numeric)}")
            super().__init__(file, fields)
            self.path, self.spec, self.fingerprint = file.path, file.spec, file.fingerprint
