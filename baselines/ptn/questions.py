"""Polycubes for the networks: images of training questions, and silhouettes of their shapes.

Perspective Transformer Nets learn from views of one object by known cameras, which questions do not
have: two images of a question may show one shape, but which two is the answer. So each image of the
unlabelled training questions is an object of its own, and is joined by silhouettes of its shape
from other sides, drawn here from the cubes and the rotation that training files tell. Training is
thus told more than other baselines: what a turntable would show of the training shapes. It is told
neither answers nor volumes.

A volume has the frame of its image: the camera's axes about the shape's centre. Its unit is the
radius of the ball that the question's camera frames, so the camera is at the same place in all.
"""

from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from baselines.pix2shape.data.rooms import channels_first, check_reducible
from baselines.ptn.batches import Batch
from baselines.ptn.network import PtnConfig
from iqtt.files.reader import open_questions, parts
from scenegen.camera import pixel_directions
from scenegen.common.errors import SpecError
from scenegen.common.rotations import rotation_matrix
from scenegen.rendering.ground_truth import decode_image

Array = NDArray[Any]
PART = "unlabeled"
BOX = (-1.0, -1.0, -1.0), (1.0, 1.0, 1.0)  # every shape fits, however turned
EXPECTED = "a training file such as iqtt-train.h5, with the group `truth`"


def check_questions(path: str | Path) -> None:
    """Raise SpecError for a file that is not ours or not for training.

    Raises as `QuestionsFile`.
    """
    if PART not in parts(path):
        raise SpecError(path, "no training questions", EXPECTED)
    with open_questions(path, PART) as questions:
        if questions.spec is None or not questions.has_truth or not len(questions):
            raise SpecError(path, "questions that tell no shapes, or none", EXPECTED)


def uniform_rotation(rng: np.random.Generator) -> Array:
    """Draw a rotation uniform on SO(3), (3, 3)."""
    quaternion = rng.standard_normal(4)
    return rotation_matrix(quaternion / np.linalg.norm(quaternion))


def meets_cubes(cubes: Array, origin: Array, direction: Array) -> Array:
    """Return whether rays meet a polycube, (R,) booleans.

    Args:
        cubes: (n, 3) integers; cube c fills [c, c + 1], and the centre of their box is at 0.
        origin, direction: (R, 3), the shape's frame, cube edges; only the half in front counts.
    """
    low = cubes - (cubes.min(axis=0) + cubes.max(axis=0) + 1) / 2
    safe = np.where(np.abs(direction) < 1e-12, 1e-12, direction)[:, None]
    sides = np.stack([low - origin[:, None], low + 1 - origin[:, None]]) / safe
    enter, leave = sides.min(axis=0).max(axis=-1), sides.max(axis=0).min(axis=-1)
    return np.asarray(((leave > enter) & (leave > 0)).any(axis=1))


class TrainingShapes:
    """The images of a training file's unlabelled questions, and silhouettes of their shapes."""

    def __init__(self, path: str | Path, config: PtnConfig) -> None:
        """Check the file. Raises as `check_questions`."""
        check_questions(path)
        self._config = config
        self._questions = open_questions(path, PART)
        try:
            height, width = self._questions.height, self._questions.width
            check_reducible(path, height, width, config.size)
        except BaseException:
            self.close()
            raise
        spec = self._questions.spec
        assert spec is not None  # as `check_questions` asks
        self._radius = 1 / spec.framing_distance(1.0)  # of the framed ball, at camera distance 1
        pose = spec.camera(1 / self._radius).world_from_camera
        self._origin = pose[:3, 3]
        rays = pixel_directions(height, width, spec.fov_y_degrees)
        self._directions = rays.reshape(-1, 3) @ pose[:3, :3].T
        self.fingerprint, self.data = str(self._questions.fingerprint), spec.to_json()

    def close(self) -> None:
        """Close the file."""
        self._questions.close()

    def batch(self, rng: np.random.Generator) -> Batch:
        """Draw images, and for each its own silhouette and those of random other sides."""
        made = [self._item(rng) for _ in range(self._config.batch)]
        image, rays, shown = (
            torch.from_numpy(np.stack(part).astype(np.float32)) for part in zip(*made, strict=True)
        )
        return Batch(image, image.new_empty(len(image), 0), rays[:, 0], rays[:, 1], shown)

    def _item(self, rng: np.random.Generator) -> tuple[Array, Array, Array]:
        config, questions = self._config, self._questions
        row = int(rng.integers(len(questions)))
        images, rotations = (
            questions.read("questions", row),
            questions.read("world_from_shape", row),
        )
        which = int(rng.integers(len(images)))
        count = int(questions.read("cube_count", row))
        cubes, rotation = questions.read("cubes", row)[which, :count], rotations[which]
        radius = self._radius * float(questions.read("camera_distance", row))  # cube edges
        rays, shown = [], []
        for view in range(config.views):
            turn = uniform_rotation(rng) if view else np.eye(3)
            pixels = rng.integers(len(self._directions), size=config.rays)
            direction = self._directions[pixels] @ turn  # turning the shape, from the volume's side
            origin = np.broadcast_to(self._origin @ turn, direction.shape)
            rays.append(np.stack([origin, direction]))
            shown.append(meets_cubes(cubes, radius * origin @ rotation, direction @ rotation))
        image = channels_first(decode_image(images[which]), config.size)
        return image, np.concatenate(rays, axis=1), np.concatenate(shown)
