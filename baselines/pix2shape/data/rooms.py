"""Rooms files as batches for the networks: linear radiance, cameras, lights and reflectance.

The model is told the camera's position, the lights and the reflectance, as in the paper. Depth maps
are read only for depth supervision, which is off unless it is asked for; normals never are.
"""

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.utils.data import Dataset, Sampler

from baselines.pix2shape.network.config import ModelConfig
from baselines.pix2shape.network.model import Views, mapped
from baselines.pix2shape.network.surfels import Scene
from iqtt.files.layout import FORMAT_NAME
from iqtt.files.tables import PARTS
from scenegen.common.errors import FileFormatError, SpecError
from scenegen.common.random.seeding import Purpose, item_rng
from scenegen.common.records import check
from scenegen.files.attributes import read_text
from scenegen.files.shards import open_with_shards
from scenegen.rendering.ground_truth import decode_image
from scenegen.rooms.reader import RoomsDataset, RoomsFile

Array = NDArray[Any]
BRIGHTEST = 65504.0  # radiance; the largest finite number of float16, in which images may be stored
FARTHEST = 1e4  # scene units; a camera farther away sees the whole room in less than a pixel
LARGEST_LIGHT = 1e6  # of colours, places and falloff
UPRIGHT = 1e-3  # of products of a pose's axes, by which they may differ from those of a rotation


@dataclass(frozen=True, eq=False)
class Relief:
    """What matching found in V views of each image's scene.

    Attributes:
        found: how far surfaces lie before the empty room, scene units, (B, V, S, S).
        world_from_camera: of these views, (B, V, 4, 4).
    """

    found: Tensor
    world_from_camera: Tensor


@dataclass(frozen=True, eq=False)
class Batch:
    """Images and what the model is told about them.

    Attributes:
        image: linear radiance, (B, 3, S, S).
        depth: planar, scene units, (B, S, S), NaN where there is no surface; None unless depth
            supervision is on.
        relief: None unless training learns from matching.
    """

    image: Tensor
    views: Views
    depth: Tensor | None = None
    relief: Relief | None = None

    def to(self, device: torch.device) -> "Batch":
        """Return the batch on another device."""
        return mapped(self, lambda values: values.to(device, non_blocking=True))


def reduced(image: Array, size: int) -> Array:
    """Return the means of square blocks: (H, W, ...) -> (S, S, ...)."""
    block = image.shape[0] // size
    return image.reshape(size, block, size, block, *image.shape[2:]).mean(axis=(1, 3))


def is_question_file(path: str | Path) -> bool:
    """Return whether a file holds questions or their answers. Raises OSError, FileFormatError."""
    with open_with_shards(Path(path), "rooms or question file")[0] as file:
        kind = read_text(file, "format", path)
        released = kind is None and any(name in file for name in ("questions", *PARTS))
        return released or kind == FORMAT_NAME


def check_reducible(where: object, height: int, width: int, size: int) -> None:
    """Raise SpecError unless images of a size can be reduced to size x size."""
    if height != width or height % size:
        expected = f"squares of a multiple of {size} pixels, the size that the networks take"
        raise SpecError(where, f"images of {height}x{width}", expected)


def camera_poses(rooms: RoomsFile) -> Array:
    """Return world_from_camera of all rows, (N, 4, 4).

    Raises FileFormatError where one is unknown, far away, or no rotation and translation.
    """
    name = "camera/world_from_camera"
    poses = _bounded(rooms, name, FARTHEST)
    turns = poses[:, :3, :3].astype(float)
    off: Array = np.abs(turns.transpose(0, 2, 1) @ turns - np.eye(3)).max(axis=(1, 2))
    mirrored, last = np.linalg.det(turns) < 0, (poses[:, 3] != (0, 0, 0, 1)).any(axis=1)
    wrong: Array = (off > UPRIGHT) | mirrored | last
    if wrong.any():
        _refuse(
            rooms, name, wrong, "a matrix that is no rotation and translation", "a camera's pose"
        )
    return poses


def _bounded(rooms: RoomsFile, name: str, most: float) -> Array:
    """Return what the networks are told of all rows. Raises FileFormatError beyond +-`most`."""
    values: Array = rooms.read(name, slice(None))
    fine = np.abs(values.reshape(len(values), -1)) <= most  # NaN is not
    if not fine.all():
        expected = f"finite numbers of at most {most:g}, as the networks are told them"
        _refuse(rooms, name, ~fine.all(axis=1), "numbers that are not finite, or huge", expected)
    return values


def _refuse(rooms: RoomsFile, name: str, wrong: Any, found: str, expected: str) -> None:
    """Raise FileFormatError for the first of the rows that are wrong, (N,)."""
    where = f"{rooms.path}: {name}, row {np.flatnonzero(wrong)[0]}"
    hint = "render the file anew with `scenegen render`, or leave this row out"
    raise FileFormatError(where, found, expected, hint)


class RoomImages(Dataset[dict[str, Any]]):
    """The images of a rooms file, a map-style dataset; each row is one item.

    Cameras and lights are small and read at once; images are read when they are asked for, in
    whichever process asks.
    """

    def __init__(self, path: str | Path, config: ModelConfig) -> None:
        """Read and check. Raises as `RoomsFile`, and SpecError where the model cannot take them."""
        spec = config.networks
        with RoomsFile(path) as rooms:
            check_reducible(path, rooms.spec.height, rooms.spec.width, spec.size)
            self.spec = rooms.spec
            self.world_from_camera = camera_poses(rooms)
            self._told = {
                name: _bounded(rooms, f"light/{name.removeprefix('light_')}", LARGEST_LIGHT)
                for name in ("light_position", "light_color", "ambient", "attenuation")
            }
            falloff = self._told["attenuation"]
            wrong: Array = (falloff < 0).any(axis=1) | (falloff.max(axis=1) <= 0)
            if wrong.any():
                expected = "numbers from 0, one of them above 0"
                _refuse(rooms, "light/attenuation", wrong, "light without a falloff", expected)
            if config.material:  # what is not told is NaN, so that nothing can use it
                self._told["reflectance"] = np.full((len(rooms), 3), np.nan)
            else:
                self._told["reflectance"] = self._uniform_reflectance(path, rooms)
            if config.lights:
                slots = self._told["light_position"].shape[1]
                check(config.lights == slots, "lights", config.lights, f"{slots}, as {path} has")
                self._told["light_position"] = np.full((len(rooms), slots, 3), np.nan)
            self.classes: tuple[str, ...] = tuple(rooms.spec.shapes)
            self.label = rooms.read("object/shape", slice(None))[:, 0]
            self._scene = rooms.read("scene_index", slice(None))
            unknown = (self.label < 0) | (self.label >= len(self.classes))
            if spec.classes and unknown.any():
                expected = f"a class of 0 to {len(self.classes) - 1}"
                _refuse(rooms, "object/shape", unknown, "a number that is no class", expected)
        if spec.classes and spec.classes != len(self.classes):
            expected = f"{spec.classes}, as the networks were made for"
            raise SpecError(path, f"{len(self.classes)} classes", expected)
        if spec.classes and self.spec.objects != (1, 1):
            raise SpecError(path, "rooms of several objects", "one object, whose class is told")
        wanted = ("image", "depth") if config.depth else ("image",)
        self.path = Path(path)
        self._relief: Array | None = None
        self._views_of = np.empty((0, 0), int)  # rows of the scene that were matched, for each row
        self._images = RoomsDataset(path, wanted)
        self.fingerprint = self._images.fingerprint
        self._networks = spec

    @staticmethod
    def _uniform_reflectance(path: str | Path, rooms: RoomsFile) -> Array:
        """Return the one reflectance of each image, (N, 3), which the model is told."""
        every = rooms.read("material/reflectance", slice(None))
        used = np.arange(every.shape[1]) <= rooms.read("object/count", slice(None))[:, None]
        shiny = rooms.read("material/specular", slice(None)).any()
        if shiny or ((every != every[:, :1]).any(axis=2) & used).any():
            expected = "one matte reflectance in each image"
            why = "the model is told the material; --set material=true learns it instead"
            raise SpecError(path, "rooms of several materials", expected, why)
        return every[:, 0]

    def __len__(self) -> int:
        return len(self.world_from_camera)

    def __getitem__(self, row: int) -> dict[str, Any]:
        """Return one image and what the model is told about it, as float32 arrays."""
        stored = self._images[row]
        where = f"{self.path}: image, row {row}"
        radiance = decode_image(stored["image"])
        item = {"image": channels_first(radiance, self._networks.size, where)}
        item |= self.view(row)
        if "depth" in stored:
            item["depth"] = reduced(stored["depth"], self._networks.size).astype(np.float32)
        if self._relief is not None:
            rows = self._views_of[row]
            item["relief"] = self._relief[rows]
            item["relief_cameras"] = self.world_from_camera[rows].astype(np.float32)
        return item

    def pick_views(self, matched: Array) -> None:
        """Pick the views of each item's scene whose relief training shall learn from.

        Args:
            matched: the rows that have a partner to be matched with, (M,).

        Raises SpecError unless every scene has as many of them.
        """
        order = matched[np.argsort(self._scene[matched], kind="stable")]
        numbers, counts = np.unique(self._scene[order], return_counts=True)
        if (counts != counts[0]).any() or len(numbers) < len(np.unique(self._scene)):
            expected = "as many views in each scene that have a neighbour to be matched with"
            raise SpecError(self.path, "more in some scenes than in others", expected)
        place = np.searchsorted(numbers, self._scene)
        self._views_of = order.reshape(-1, counts[0])[place]

    def learn_from(self, relief: Array) -> None:
        """Add to each item the relief of the picked views, of all rows, (N, S, S), scene units."""
        self._relief = relief

    def as_batch(self, items: dict[str, Tensor]) -> Batch:
        """Return the batch of collated items."""
        return as_batch(items, self.spec.fov_y_degrees)

    def view(self, row: int, world_from_camera: Array | None = None) -> dict[str, Any]:
        """Return what the model is told about a row, as its own or as another camera sees it."""
        pose = self.world_from_camera[row] if world_from_camera is None else world_from_camera
        condition = [pose[:3, 3]] if self._networks.camera else []
        if self._networks.classes:
            condition.append(np.eye(self._networks.classes)[self.label[row]])
        known = {name: values[row] for name, values in self._told.items()}
        known["light_position"] = (known["light_position"] - pose[:3, 3]) @ pose[:3, :3]
        known["condition"] = np.concatenate([np.empty(0), *condition])
        known["world_from_camera"] = pose
        return {name: np.float32(value) for name, value in known.items()}


def room_image(rooms: RoomsFile, row: int, size: int) -> Array:
    """Return the image of a row as the networks take it, (3, S, S). Raises as `channels_first`."""
    where = f"{rooms.path}: image, row {row}"
    return channels_first(decode_image(rooms.read("image", row)), size, where)


def room_images(rooms: RoomsFile, rows: Array, size: int) -> Tensor:
    """Return the images of rows as the networks take them, (B, 3, S, S). Raises as `room_image`."""
    return torch.from_numpy(np.stack([room_image(rooms, int(row), size) for row in rows]))


def row_batches(count: int, size: int) -> Iterator[Array]:
    """Yield the numbers 0 to count - 1 in batches of a size, of which the last may be smaller."""
    return (np.arange(first, min(first + size, count)) for first in range(0, count, size))


def channels_first(radiance: Array, size: int, where: object = "image") -> Array:
    """Return an image as the networks take it, float32: (H, W, 3) -> (3, S, S).

    Raises FileFormatError, which names `where`, unless all radiance is finite and not huge: what is
    not would crash networks, or come out as a depth that looks like any other.
    """
    small = reduced(radiance, size)
    if not max(abs(small.min()), abs(small.max())) <= BRIGHTEST:  # NaN is not
        expected = f"finite numbers of at most {BRIGHTEST:g}"
        raise FileFormatError(where, "radiance that is not finite, or huge", expected)
    return np.ascontiguousarray(np.moveaxis(small, -1, 0), dtype=np.float32)


def as_batch(items: dict[str, Tensor], fov_y_degrees: float) -> Batch:
    """Return the batch of the collated fields of items."""
    relief = Relief(items["relief"], items["relief_cameras"]) if "relief" in items else None
    return Batch(items["image"], as_views(items, fov_y_degrees), items.get("depth"), relief)


def as_views(items: dict[str, Tensor], fov_y_degrees: float) -> Views:
    """Return the views of the collated fields of items."""
    known = {f.name: items[f.name] for f in fields(Scene) if f.name in items}
    scene = Scene(fov_y_degrees, **known)
    return Views(items["condition"], scene, items.get("background"), items.get("world_from_camera"))


class Draws(Sampler[list[int]]):
    """Rows of batch after batch without end; every epoch goes through all rows in a new order.

    The rows of a batch depend on its number alone, so that training can go on where it stopped.
    """

    def __init__(
        self, rows: int, batch: int, seed: int, first: int = 0, share: slice = slice(None)
    ) -> None:
        """Begin with batch `first`; this process takes a `share` of the rows of every batch."""
        self._rows, self._batch, self._seed = rows, batch, seed
        self._first, self._share = first, share

    def __iter__(self) -> Iterator[list[int]]:
        epoch, order = -1, np.empty(0, int)
        for number in itertools.count(self._first):
            rows: list[int] = []
            for place in range(number * self._batch, (number + 1) * self._batch):
                if place // self._rows != epoch:
                    epoch = place // self._rows
                    order = item_rng(self._seed, epoch, Purpose.ORDER).permutation(self._rows)
                rows.append(int(order[place % self._rows]))
            yield rows[self._share]
