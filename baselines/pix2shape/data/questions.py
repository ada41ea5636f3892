"""Questions as batches for the networks: images and their lights; labels where there are any."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from torch import Tensor
from torch.utils.data import Dataset

from baselines.pix2shape.data.rooms import Batch, as_batch, channels_first, check_reducible
from baselines.pix2shape.network.config import ModelConfig
from iqtt.files.reader import QuestionsDataset, open_questions, parts
from scenegen.common.errors import SpecError
from scenegen.common.records import check
from scenegen.rendering.ground_truth import decode_image

Z_VIEW = 10  # dimensions of the code that tell the view, of the paper's 128


class QuestionImages(Dataset[dict[str, Any]]):
    """The four images of each question, each with its lights; answers where they are told.

    The lights are known to the model, as in the paper; shapes and rotations are not read.
    """

    def __init__(self, path: str | Path, part: str | None, config: ModelConfig) -> None:
        """Check the file. Raises as `QuestionsFile`, and SpecError where lights are not told."""
        self._size = config.networks.size
        if config.networks.condition:
            raise SpecError("networks: told camera or class, expected neither, as for questions")
        with open_questions(path, part) as questions:
            check_reducible(path, questions.height, questions.width, self._size)
            if questions.spec is None or not questions.has_truth or not len(questions):
                raise SpecError(
                    f"{path}: found {len(questions)} questions"
                    f" {'with' if questions.has_truth else 'without'} lights, expected some, with"
                    " the group `truth` that tells them (iqtt make-split writes it)"
                )
            self._spec = questions.spec
            fields = ["questions", "light_position", "light_color"]
            self.has_answers = questions.has_answers
        self._rows = QuestionsDataset(
            path, part, [*fields, "answers"] if self.has_answers else fields
        )
        self.fingerprint = self._rows.fingerprint
        self.fov_y_degrees = self._spec.camera.fov_y_degrees
        self._camera = self._spec.camera.world_from_camera

    def __len__(self) -> int:
        return len(self._rows)

    def __getitem__(self, row: int) -> dict[str, Any]:
        """Return a question: arrays of four rows, and the answer."""
        stored = self._rows[row]
        images = decode_image(stored["questions"])
        place = self._camera[:3, 3]
        known = {
            "image": np.stack([channels_first(image, self._size) for image in images]),
            "condition": np.empty((4, 0)),
            "light_position": (stored["light_position"] - place) @ self._camera[:3, :3],
            "light_color": stored["light_color"],
            "ambient": np.tile(self._spec.ambient, (4, 1)),
            "attenuation": np.tile((0.0, 1.0), (4, 1)),
            "reflectance": np.tile(self._spec.reflectance, (4, 1)),
            "background": np.tile(self._spec.background, (4, 1)),
        }
        item: dict[str, Any] = {name: np.float32(value) for name, value in known.items()}
        if self.has_answers:
            item["answer"] = int(stored["answers"])
        return item

    def as_batch(self, items: dict[str, Tensor]) -> Batch:
        """Put collated questions together, four images each, one question after the other."""
        flat = {name: value.flatten(0, 1) for name, value in items.items() if name != "answer"}
        return as_batch(flat, self.fov_y_degrees)


def for_questions(config: ModelConfig, path: str | Path, part: str | None) -> ModelConfig:
    """Return a configuration for the images of a question file.

    As the paper has it: no camera, the code's last ten dimensions for the view. The depths that the
    decoder gives are those of the sphere that the camera frames. Codes are standardised, or L_theta
    would drive them apart without end, a critic or not.

    Raises SpecError for a released file, and one that is not for training.
    """
    if len(parts(path)) < 2:
        raise SpecError(f"{path}: expected training questions, such as iqtt-train.h5")
    least = Z_VIEW + 1
    check(
        config.networks.z >= least, "z scene", config.networks.z, f"{least} or more, for questions"
    )
    with open_questions(path, part) as questions:
        if questions.spec is None:
            raise SpecError(f"{path}: a released file, expected one of iqtt make-split")
        distance = float(np.linalg.norm(questions.spec.camera.world_from_camera[:3, 3]))
        radius = questions.spec.max_radius
    spec = config.networks
    return replace(
        config,
        networks=replace(
            spec,
            camera=False,
            classes=0,
            z_scene=spec.z - Z_VIEW,
            z_view=Z_VIEW,
            standardised=True,
        ),
        depth_middle=distance,
        depth_reach=min(0.9, radius / distance),
        opacity=True,
        consistency=0.0,
    )
