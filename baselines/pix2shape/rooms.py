"""Rooms as items for the networks: images, cameras, lights and reflectance.

The model is told the camera's position, the lights and the reflectance, as in the paper. Depth maps
are read only for depth supervision, which is off unless it is asked for; normals never are.
"""

from typing import Any

import numpy as np
from torch import Tensor
from torch.utils.data import Dataset

from baselines.pix2shape.batch import Batch, as_batch
from baselines.pix2shape.network.config import ModelConfig
from baselines.training.data import Opened
from baselines.training.images import Array, check_reducible, reduced
from baselines.training.rooms import bounded, camera_poses, refuse_rows, room_image
from scenegen.common.errors import SpecError
from scenegen.common.records import check
from scenegen.rooms.reader import RoomsFile

LARGEST_LIGHT = 1e6  # of colours, places and falloff


class RoomImages(Dataset[dict[str, Any]]):
    """The images of a rooms file, a map-style dataset; each row is one item.

    Cameras and lights are small and read at once; images are read when they are asked for, in
    whichever process asks.
    """

    def __init__(self, opened: Opened[RoomsFile], config: ModelConfig) -> None:
        """Check an open file.

        Raises FileFormatError, and SpecError where the model cannot take its rooms.
        """
        networks, rooms = config.networks, opened.file
        path = self.path = rooms.path
        check_reducible(path, rooms.spec.height, rooms.spec.width, networks.size)
        self.opened, self.spec, self.fingerprint = opened, rooms.spec, rooms.fingerprint
        self._networks, self._with_depth = networks, bool(config.depth)
        self.world_from_camera = camera_poses(rooms)
        self._told = self._lights(rooms, config)
        if config.material:  # what is not told is NaN, so that nothing can use it
            self._told["reflectance"] = np.full((len(rooms), 3), np.nan)
        else:
            self._told["reflectance"] = self._uniform_reflectance(rooms)
        self.classes: tuple[str, ...] = tuple(rooms.spec.shapes)
        self.label = rooms.read("object/shape", slice(None))[:, 0]
        self._scene = rooms.read("scene_index", slice(None))
        if networks.classes:
            count = len(self.classes)
            unknown = (self.label < 0) | (self.label >= count)
            refuse_rows(rooms, "object/shape", unknown, "no class", f"a class of 0 to {count - 1}")
            expected = f"{networks.classes}, as the networks were made for"
            check(networks.classes == count, str(path), f"{count} classes", expected)
            if self.spec.objects != (1, 1):
                raise SpecError(path, "rooms of several objects", "one object, whose class is told")
        self._relief: Array | None = None
        self._views_of = np.empty((0, 0), int)  # rows of the scene that were matched, for each row

    @staticmethod
    def _lights(rooms: RoomsFile, config: ModelConfig) -> dict[str, Array]:
        """Return what the model is told of the lights of all rows."""
        names = ("light_position", "light_color", "ambient", "attenuation")
        lights = {
            name: bounded(rooms, f"light/{name.removeprefix('light_')}", LARGEST_LIGHT)
            for name in names
        }
        falloff = lights["attenuation"]
        wrong: Array = (falloff < 0).any(axis=1) | (falloff.max(axis=1) <= 0)
        expected = "numbers from 0, one of them above 0"
        refuse_rows(rooms, "light/attenuation", wrong, "light without a falloff", expected)
        if config.lights:
            slots = lights["light_position"].shape[1]
            check(config.lights == slots, "lights", config.lights, f"{slots}, as {rooms.path} has")
            lights["light_position"] = np.full((len(rooms), slots, 3), np.nan)
        return lights

    @staticmethod
    def _uniform_reflectance(rooms: RoomsFile) -> Array:
        """Return the one reflectance of each image, (N, 3), which the model is told."""
        every = rooms.read("material/reflectance", slice(None))
        used = np.arange(every.shape[1]) <= rooms.read("object/count", slice(None))[:, None]
        shiny = rooms.read("material/specular", slice(None)).any()
        if shiny or ((every != every[:, :1]).any(axis=2) & used).any():
            expected = "one matte reflectance in each image"
            hint = "the model is told the material; --set material=true learns it instead"
            raise SpecError(rooms.path, "rooms of several materials", expected, hint)
        return every[:, 0]

    def __len__(self) -> int:
        return len(self.world_from_camera)

    def __getitem__(self, row: int) -> dict[str, Any]:
        """Return one image and what the model is told about it, as float32 arrays."""
        size, rooms = self._networks.size, self.opened.file
        item = {"image": room_image(rooms, row, size), **self.view(row)}
        if self._with_depth:
            item["depth"] = reduced(rooms.read("depth", row), size).astype(np.float32)
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
        told = {name: values[row] for name, values in self._told.items()}
        told["light_position"] = (told["light_position"] - pose[:3, 3]) @ pose[:3, :3]
        told["condition"] = np.concatenate([np.empty(0), *condition])
        told["world_from_camera"] = pose
        return {name: np.float32(value) for name, value in told.items()}
