"""Images of one object each, and the lights that are told with them: what the model learns from."""

from dataclasses import dataclass, replace

import numpy as np

from baselines.rezende.rasteriser import Views
from baselines.training.images import Array, check_reducible
from baselines.training.questions import check_truth, question_images, question_lights
from iqtt import QuestionsFile

MOST_QUESTIONS = 5_000  # that are read; their 20,000 small images take 250 MB


@dataclass(frozen=True, eq=False)
class Pictures:
    """N images of one object each, in memory.

    Attributes:
        image: linear radiance, (N, 3, S, S) float32.
        radius: of the sphere that the mesh starts from, in the unit of `views`.
        views: camera and shading of the images, with their N rows of lights.
        fingerprint: of the data, so that a run goes on with the data that it began with.
    """

    image: Array
    radius: float
    views: Views
    fingerprint: str

    def __len__(self) -> int:
        return len(self.image)

    def views_of(self, rows: Array) -> Views:
        """Return the camera and the lights of some images."""
        position, color = self.views.light_position[rows], self.views.light_color[rows]
        return replace(self.views, light_position=position, light_color=color)


def read_question_pictures(questions: QuestionsFile, size: int) -> Pictures:
    """Read the images of a file's first questions, at most MOST_QUESTIONS, four after four.

    As in the Pix2Shape paper, lights, cameras, reflectance and background are told; shapes,
    rotations and answers are not read. The mesh starts from half the sphere that the camera frames.
    Lengths are scaled so that every question has the same distance of the camera, which changes no
    image.

    Raises FileFormatError; SpecError where the file tells no lights, or its images cannot be
    reduced to `size` x `size`.
    """
    check_truth(questions)
    check_reducible(questions.path, questions.height, questions.width, size)
    spec, count = questions.spec, min(len(questions), MOST_QUESTIONS)
    assert spec is not None, "check_truth asks for it"
    images = [image for row in range(count) for image in question_images(questions, row, size)]
    position, color = question_lights(questions, count)
    rows = len(images), position.shape[2], 3
    views = Views(
        size=size,
        fov_y_degrees=spec.fov_y_degrees,
        distance=spec.camera_distance,
        reflectance=np.array(spec.reflectance),
        ambient=np.array(spec.ambient),
        background=np.array(spec.background),
        attenuation=(0.0, 1.0),
        light_position=position.reshape(rows),
        light_color=color.reshape(rows),
    )
    return Pictures(np.stack(images), 0.5 * spec.max_radius, views, str(questions.fingerprint))
