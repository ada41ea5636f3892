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

import numpy as np
import torch

from baselines.ptn.network import Settings
from baselines.ptn.projection import Batch
from baselines.training.images import Array, channels_first, check_reducible
from baselines.training.questions import check_truth
from iqtt import QuestionsFile
from scenegen.camera import pixel_directions
from scenegen.common.rotations import rotation_matrix
from scenegen.rendering.ground_truth import decode_image

BOX = (-1.0, -1.0, -1.0), (1.0, 1.0, 1.0)  # every shape fits, however turned


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

    def __init__(self, questions: QuestionsFile, settings: Settings) -> None:
        """Check an open file. Raises as `check_truth` and `check_reducible`."""
        check_truth(questions)
        height, width = questions.height, questions.width
        check_reducible(questions.path, height, width, settings.size)
        self._settings, self._questions = settings, questions
        spec = questions.cube_spec
        assert spec is not None, "check_truth asks for it"
        self._radius = 1 / spec.framing_distance(1.0)  # of the framed ball, at camera distance 1
        pose = spec.camera(1 / self._radius).world_from_camera
        self._origin = pose[:3, 3]
        rays = pixel_directions(height, width, spec.fov_y_degrees)
        self._directions = rays.reshape(-1, 3) @ pose[:3, :3].T
        self.fingerprint, self.data = str(questions.fingerprint), spec.to_json()

    def batch(self, rng: np.random.Generator) -> Batch:
        """Draw images, and for each its own silhouette and those of random other sides."""
        made = [self._item(rng) for _ in range(self._settings.batch)]
        image, rays, shown = (
            torch.from_numpy(np.stack(part).astype(np.float32)) for part in zip(*made, strict=True)
        )
        return Batch(image, image.new_empty(len(image), 0), rays[:, 0], rays[:, 1], shown)

    def _item(self, rng: np.random.Generator) -> tuple[Array, Array, Array]:
        settings, questions = self._settings, self._questions
        row = int(rng.integers(len(questions)))
        images, rotations = (
            questions.read("questions", row),
            questions.read("world_from_shape", row),
        )
        image = int(rng.integers(len(images)))
        count = int(questions.read("cube_count", row))
        cubes, rotation = questions.read("cubes", row)[image, :count], rotations[image]
        radius = self._radius * float(questions.read("camera_distance", row))  # cube edges
        rays, shown = [], []
        for view in range(settings.views):
            turn = uniform_rotation(rng) if view else np.eye(3)
            pixels = rng.integers(len(self._directions), size=settings.rays)
            direction = self._directions[pixels] @ turn  # turning the shape, from the volume's side
            origin = np.broadcast_to(self._origin @ turn, direction.shape)
            rays.append(np.stack([origin, direction]))
            shown.append(meets_cubes(cubes, radius * origin @ rotation, direction @ rotation))
        seen = channels_first(decode_image(images[image]), settings.size)
        return seen, np.concatenate(rays, axis=1), np.concatenate(shown)
