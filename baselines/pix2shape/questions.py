"""Questions as items for the networks: images, their lights, and answers if there are any."""

from dataclasses import replace
from typing import Any

import numpy as np
from torch import Tensor
from torch.utils.data import Dataset

from baselines.pix2shape.batch import Batch, as_batch
from baselines.pix2shape.network.config import ModelConfig
from baselines.pix2shape.network.polar import BRIGHT
from baselines.training.data import Opened
from baselines.training.images import check_reducible
from baselines.training.questions import check_truth, question_images, question_lights
from iqtt import QuestionsFile
from scenegen.common.errors import SpecError
from scenegen.common.records import check

Z_VIEW = 10  # of the code's 128 dimensions, those that tell the view, as in the paper


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
            raise SpecError("networks", "a camera or class to be told", "neither, for questions")
        check_reducible(questions.path, questions.height, questions.width, size)
        check_truth(questions)
        assert questions.spec is not None, "check_truth asks for it"
        self._opened, self._size, self.spec = opened, size, questions.spec
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
    spec = questions.spec
    if config.networks.encoder == "polar" and spec is not None and min(spec.background) < BRIGHT:
        expected = "white, by which the polar encoder tells shape from background"
        raise SpecError(questions.path, f"a background of {spec.background}", expected)


def for_questions(config: ModelConfig, questions: QuestionsFile) -> ModelConfig:
    """Return a configuration for the images of a question file.

    As in the paper the networks are not told the camera, and the last ten dimensions of the code
    are for the view. The decoder gives depths within the sphere that the camera frames. Codes are
    standardised, as L_theta has no lower bound and would drive them apart without end.

    Raises SpecError for settings that do not suit, and for a file of the paper's authors.
    """
    check(config.depth == 0, "depth", config.depth, "0 for questions, which have no depth maps")
    check(not config.material, "material", config.material, "false for questions, which tell it")
    check(not config.lights, "lights", config.lights, "0 for questions, which tell them")
    spec = config.networks
    check(spec.z_view in (0, Z_VIEW), "z view", spec.z_view, f"{Z_VIEW}, for questions")
    check(spec.z > Z_VIEW, "z scene", spec.z, f"{Z_VIEW + 1} or more, for questions")
    check_truth(questions)
    check_background(questions, config)
    assert questions.spec is not None, "check_truth asks for it"
    distance = questions.spec.camera_distance
    spec = replace(spec, camera=False, classes=0, standardised=True)
    spec = replace(spec, z_scene=spec.z - Z_VIEW, z_view=Z_VIEW)
    reach = min(0.9, questions.spec.max_radius / distance)
    config = replace(config, networks=spec, depth_middle=distance, depth_reach=reach)
    return replace(config, opacity=True)
