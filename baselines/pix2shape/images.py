"""Images of rooms and of questions for the networks, and what the model is told about them.

It is told lights and reflectance, as in the paper; of rooms also the camera's position, and of
training questions the answer where the file has one. Depth maps are read only for depth
supervision, which is off unless it is asked for; normals never are.

Images of questions may be turned about the viewing axis, and mirrored. The camera looks at the
centre of the shape's bounding box, so a turned picture shows the same shape turned about the
viewing axis, under lights that turned with it. A question whose pictures are all mirrored asks of
the mirror images what it asked before, and has the same answer.
"""

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional
from torch.utils.data import Dataset

from baselines.pix2shape.network.config import ModelConfig
from baselines.pix2shape.network.model import Views
from baselines.pix2shape.network.polar import BRIGHT
from baselines.pix2shape.network.surfels import Scene
from baselines.training.data import Opened
from baselines.training.images import Array, check_reducible, mapped, reduced
from baselines.training.questions import check_truth, question_images, question_lights
from baselines.training.rooms import bounded, camera_poses, refuse_rows, room_image
from iqtt import QuestionsFile
from scenegen.common.errors import SpecError
from scenegen.common.records import check
from scenegen.rooms.reader import RoomsFile

LARGEST_LIGHT = 1e6  # of colours, places and falloff
Z_VIEW = 10  # of the code's 128 dimensions, those that tell the view, as in the paper


@dataclass(frozen=True, eq=False)
class Relief:
    """What matching found in V views of each image's scene.

    Attributes:
        values: how far surfaces lie before the empty room, scene units, (B, V, S, S).
        world_from_camera: of these views, (B, V, 4, 4).
    """

    values: Tensor
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


def as_batch(items: dict[str, Tensor], fov_y_degrees: float) -> Batch:
    """Return the batch of the collated fields of items."""
    relief = Relief(items["relief"], items["relief_cameras"]) if "relief" in items else None
    return Batch(items["image"], as_views(items, fov_y_degrees), items.get("depth"), relief)


def as_views(items: dict[str, Tensor], fov_y_degrees: float) -> Views:
    """Return the views of the collated fields of items."""
    values = {f.name: items[f.name] for f in fields(Scene) if f.name in items}
    scene = Scene(fov_y_degrees, **values)
    return Views(items["condition"], scene, items.get("background"), items.get("world_from_camera"))


def turned(batch: Batch, angle: Tensor, mirror: Tensor) -> Batch:
    """Return a batch whose images are mirrored, left to right, and then turned, with their lights.

    Args:
        angle: counter-clockwise, radians, (B,).
        mirror: which images are mirrored, (B,) booleans.
    """
    sign = torch.where(mirror, -1.0, 1.0)
    cosine, sine = torch.cos(angle), torch.sin(angle)
    # From places in the new image, x to the right and y down, to those in the old one.
    back = torch.stack([sign * cosine, -sign * sine, sine, cosine], dim=1).view(-1, 2, 2)
    place = functional.affine_grid(
        torch.cat([back, torch.zeros_like(back[..., :1])], dim=2),
        list(batch.image.shape),
        align_corners=False,
    )
    # The corners lie beyond the image, where there is background as at its border.
    image = functional.grid_sample(batch.image, place, padding_mode="border", align_corners=False)
    x, y, z = batch.views.scene.light_position.unbind(dim=2)
    x, cosine, sine = sign[:, None] * x, cosine[:, None], sine[:, None]
    lights = torch.stack([cosine * x - sine * y, sine * x + cosine * y, z], dim=2)
    scene = replace(batch.views.scene, light_position=lights)
    return replace(batch, image=image, views=replace(batch.views, scene=scene))


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
                raise SpecError(
                    path, "rooms of several objects", "one object, whose category is an input"
                )
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
            hint = "the material is an input of the model; --set material=true learns it instead"
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


class QuestionImages(Dataset[dict[str, Any]]):
    """The images of each question, a map-style dataset.

    The model is told the lights, the reflectance and the background of each image, as in the
    paper, and the answer where the file has one. Of the camera only its distance is read, in which
    the places of lights are measured. Shapes, directions of cameras and rotations are never read.
    """

    classes: tuple[str, ...] = ()  # as RoomImages has; the networks are told none

    def __init__(self, opened: Opened[QuestionsFile], config: ModelConfig) -> None:
        """Check an open file. Raises FileFormatError, and SpecError where it tells no lights."""
        questions, size = opened.file, config.networks.size
        if config.networks.condition:
            raise SpecError("networks", "a camera or category as input", "neither, for questions")
        check_reducible(questions.path, questions.height, questions.width, size)
        check_truth(questions)
        spec = questions.cube_spec
        assert spec is not None, "check_truth asks for it"
        self._opened, self._size, self.spec = opened, size, spec
        self.fingerprint = questions.fingerprint
        self.has_answers = questions.has_answers
        self._places, self._colors = question_lights(questions, len(questions))

    def __len__(self) -> int:
        return len(self._places)

    def __getitem__(self, row: int) -> dict[str, Any]:
        """Return a question: float32 arrays with a row an image, and the answer if there is one."""
        images = question_images(self._opened.file, row, self._size)
        place = (0.0, 0.0, self.spec.camera_distance)
        told = {
            "image": images,
            "condition": np.empty((len(images), 0)),
            "light_position": self._places[row] - place,
            "light_color": self._colors[row],
            "attenuation": np.tile((0.0, 1.0), (len(images), 1)),
        }
        for name in ("ambient", "reflectance", "background"):
            told[name] = np.tile(getattr(self.spec, name), (len(images), 1))
        item: dict[str, Any] = {name: np.float32(value) for name, value in told.items()}
        if self.has_answers:
            item["answer"] = int(self._opened.file.read("answers", row))
        return item

    def as_batch(self, items: dict[str, Tensor]) -> Batch:
        """Return the batch of collated questions, question by question."""
        flat = {name: value.flatten(0, 1) for name, value in items.items() if name != "answer"}
        return as_batch(flat, self.spec.fov_y_degrees)


def check_background(questions: QuestionsFile, config: ModelConfig) -> None:
    """Raise SpecError where the polar encoder would take a background for part of the shape."""
    spec = questions.cube_spec
    if config.networks.encoder == "polar" and spec is not None and min(spec.background) < BRIGHT:
        expected = "white, because the polar encoder detects the shape by a white background"
        raise SpecError(questions.path, f"a background of {spec.background}", expected)


def for_questions(config: ModelConfig, questions: QuestionsFile) -> ModelConfig:
    """Return a configuration for the images of a question file.

    As in the paper the networks are not told the camera, and the last ten dimensions of the code
    are for the view. The decoder gives depths within the sphere that the camera frames. Codes are
    standardised, as L_theta has no lower bound and would drive them apart without end.

    Raises SpecError for settings that do not suit, and for a file of the paper's authors.
    """
    check(config.depth == 0, "depth", config.depth, "0 for questions, which have no depth maps")
    check(
        not config.material, "material", config.material, "false for questions, where it is given"
    )
    check(not config.lights, "lights", config.lights, "0 for questions, where lights are given")
    spec = config.networks
    check(spec.z_view in (0, Z_VIEW), "z view", spec.z_view, f"{Z_VIEW}, for questions")
    check(spec.z > Z_VIEW, "z scene", spec.z, f"{Z_VIEW + 1} or more, for questions")
    check_truth(questions)
    check_background(questions, config)
    asked = questions.cube_spec
    assert asked is not None, "check_truth asks for it"
    distance = asked.camera_distance
    spec = replace(spec, camera=False, classes=0, standardised=True)
    spec = replace(spec, z_scene=spec.z - Z_VIEW, z_view=Z_VIEW)
    reach = min(0.9, asked.max_radius / distance)
    config = replace(config, networks=spec, depth_middle=distance, depth_reach=reach)
    return replace(config, opacity=True)
