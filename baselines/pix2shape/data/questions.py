"""Question files as batches for the networks: images, their lights, and labels if there are any."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from torch import Tensor
from torch.utils.data import Dataset

from baselines.pix2shape.data.rooms import Batch, as_batch, channels_first, check_reducible
from baselines.pix2shape.network.config import ModelConfig
from baselines.pix2shape.network.polar import BRIGHT
from iqtt.files.reader import QuestionsDataset, open_questions, parts
from iqtt.questions.specs import SplitSpec
from scenegen.common.errors import FileFormatError, SpecError
from scenegen.common.records import check
from scenegen.rendering.ground_truth import decode_image

Z_VIEW = 10  # of the code's 128 dimensions, those that tell the view, as in the paper


class QuestionImages(Dataset[dict[str, Any]]):
    """The images of each question, a map-style dataset.

    The model is told the lights, the reflectance and the background of each image, as in the
    paper, and the answer where the file has one. Of the camera only its distance is read, in which
    the places of lights are measured. Shapes, directions of cameras and rotations are never read.
    """

    classes: tuple[str, ...] = ()  # as RoomImages has; the networks are told none

    def __init__(self, path: str | Path, part: str | None, config: ModelConfig) -> None:
        """Check the file. Raises as `QuestionsFile`, and SpecError where it tells no lights."""
        self._path, self._size = path, config.networks.size
        if config.networks.condition:
            raise SpecError("networks", "a camera or class to be told", "neither, for questions")
        with open_questions(path, part) as questions:
            check_reducible(path, questions.height, questions.width, self._size)
            if questions.spec is None or not questions.has_truth or not len(questions):
                lights = "with" if questions.has_truth else "without"
                expected = "some, with the group `truth` that tells the lights"
                found, hint = (
                    f"{len(questions)} questions {lights} lights",
                    "`iqtt make-split` writes it",
                )
                raise SpecError(path, found, expected, hint)
            self.spec = questions.spec
            self.has_answers = questions.has_answers
        fields = ["questions", "camera_distance", "light_position", "light_color"]
        fields += ["answers"] * self.has_answers
        self._rows = QuestionsDataset(path, part, fields)
        self.fingerprint = self._rows.fingerprint
        self.fov_y_degrees = self.spec.fov_y_degrees

    def __len__(self) -> int:
        return len(self._rows)

    def __getitem__(self, row: int) -> dict[str, Any]:
        """Return a question: float32 arrays with a row an image, and the answer if there is one."""
        stored = self._rows[row]
        images, where = decode_image(stored["questions"]), f"{self._path}: row {row}"
        # All lengths are scaled to one distance of the camera; no image changes by that, as the
        # lights are made brighter by the square of the scale.
        scale = self.spec.camera_distance / stored["camera_distance"]
        place = (0.0, 0.0, self.spec.camera_distance)
        known = {
            "image": np.stack([channels_first(image, self._size, where) for image in images]),
            "condition": np.empty((len(images), 0)),
            "light_position": scale * stored["light_position"] - place,
            "light_color": scale**2 * stored["light_color"],
            "attenuation": np.tile((0.0, 1.0), (len(images), 1)),
        }
        for name in ("ambient", "reflectance", "background"):
            known[name] = np.tile(getattr(self.spec, name), (len(images), 1))
        item: dict[str, Any] = {name: np.float32(value) for name, value in known.items()}
        for name, value in item.items():
            if not np.isfinite(value).all():
                raise FileFormatError(where, f"{name} that is not finite", "finite numbers")
        if self.has_answers:
            item["answer"] = int(stored["answers"])
        return item

    def as_batch(self, items: dict[str, Tensor]) -> Batch:
        """Return the batch of collated questions, question by question."""
        flat = {name: value.flatten(0, 1) for name, value in items.items() if name != "answer"}
        return as_batch(flat, self.fov_y_degrees)


def check_background(where: object, spec: SplitSpec | None, config: ModelConfig) -> None:
    """Raise SpecError where the polar encoder would take a background for part of the shape."""
    if config.networks.encoder == "polar" and spec is not None and min(spec.background) < BRIGHT:
        expected = "white, by which the polar encoder tells shape from background"
        raise SpecError(where, f"a background of {spec.background}", expected)


def for_questions(config: ModelConfig, path: str | Path, part: str | None) -> ModelConfig:
    """Return a configuration for the images of a question file.

    As in the paper the networks are not told the camera, and the last ten dimensions of the code
    are for the view. The decoder gives depths within the sphere that the camera frames. Codes are
    standardised, as L_theta has no lower bound and would drive them apart without end.

    Raises SpecError for a file that is not for training, and for one of the paper's authors.
    """
    if len(parts(path)) < 2:
        raise SpecError(path, "no training questions", "a training file such as iqtt-train.h5")
    check(not config.material, "material", config.material, "false for questions, which tell it")
    check(not config.lights, "lights", config.lights, "0 for questions, which tell them")
    spec = config.networks
    check(spec.z_view in (0, Z_VIEW), "z view", spec.z_view, f"{Z_VIEW}, for questions")
    check(spec.z > Z_VIEW, "z scene", spec.z, f"{Z_VIEW + 1} or more, for questions")
    with open_questions(path, part) as questions:
        if questions.spec is None:
            raise SpecError(path, "a released file", "one that `iqtt make-split` wrote")
        check_background(path, questions.spec, config)
        distance = questions.spec.camera_distance
        radius = questions.spec.max_radius
    spec = replace(spec, camera=False, classes=0, standardised=True)
    spec = replace(spec, z_scene=spec.z - Z_VIEW, z_view=Z_VIEW)
    reach = min(0.9, radius / distance)
    config = replace(config, networks=spec, depth_middle=distance, depth_reach=reach)
    return replace(config, opacity=True, consistency=0.0)
