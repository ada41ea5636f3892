"""Images of one object each, and the lights that are told with them: what the model learns from."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baselines.pix2shape.data.rooms import channels_first, check_reducible
from baselines.rezende.rasteriser import Views
from iqtt.files.reader import open_questions, parts
from scenegen.common.errors import FileFormatError, SpecError
from scenegen.rendering.ground_truth import decode_image

Array = NDArray[Any]
MOST_QUESTIONS = 5_000  # that are read; their 20,000 small images take 250 MB


@dataclass(frozen=True, eq=False)
class Pictures:
    """N images of one object each, in memory.

    Attributes:
        image: linear radiance, (N, 3, S, S) float32.
        radius: of the sphere that the mesh starts from, in the unit of `views`.
        views: camera and shading of the images, with their N rows of lights.
        fingerprint: of the data, so that a run goes on with the data that it began with.
        depth: true planar depth, (N, S, S), infinite where there is no object; only to measure
            with. None where it is not known.
    """

    image: Array
    radius: float
    views: Views
    fingerprint: str
    depth: Array | None = None

    def __len__(self) -> int:
        return len(self.image)

    def views_of(self, rows: Array) -> Views:
        """Return the camera and the lights of some images."""
        position, color = self.views.light_position[rows], self.views.light_color[rows]
        return replace(self.views, light_position=position, light_color=color)


def read_question_pictures(path: str | Path, size: int, part: str | None) -> Pictures:
    """Read the images of a file's first questions, at most MOST_QUESTIONS, four after four.

    As in the Pix2Shape paper, lights, cameras, reflectance and background are told; shapes,
    rotations and answers are not read. The mesh starts from half the sphere that the camera frames.
    Lengths are scaled so that every question has the same distance of the camera, which changes no
    image.

    Raises as `QuestionsFile`, and SpecError where the file tells no lights, or its images cannot
    be reduced to `size` x `size`.
    """
    with open_questions(path, part) as questions:
        check_reducible(path, questions.height, questions.width, size)
        spec, count = questions.spec, min(len(questions), MOST_QUESTIONS)
        if spec is None or not questions.has_truth or not count:
            lights = "with" if questions.has_truth else "without"
            found = f"{len(questions)} questions {lights} lights"
            expected = "some, with the group `truth` that tells the lights"
            raise SpecError(path, found, expected, "`iqtt make-split` writes it")
        images = []
        for row in range(count):
            images += question_images(questions.read("questions", row), size)
        names = "light_position", "light_color", "camera_distance"
        position, color, distance = (questions.read(name, slice(0, count)) for name in names)
        if not (np.isfinite(position).all() and np.isfinite(color).all()):
            found = "light_position or light_color that is not finite"
            raise FileFormatError(path, found, "the lights of each image")
        fingerprint = str(questions.fingerprint)
    scale = (spec.camera_distance / distance)[:, None, None, None]
    rows = len(images), position.shape[2], 3
    views = Views(
        size=size,
        fov_y_degrees=spec.fov_y_degrees,
        distance=spec.camera_distance,
        reflectance=np.array(spec.reflectance),
        ambient=np.array(spec.ambient),
        background=np.array(spec.background),
        attenuation=(0.0, 1.0),
        light_position=(position * scale).reshape(rows),
        light_color=(color * scale**2).reshape(rows),  # as light falls off with the square
    )
    return Pictures(np.stack(images), 0.5 * spec.max_radius, views, fingerprint)


def question_images(stored: Array, size: int) -> list[Array]:
    """Return the images of one question as the encoder takes them, (3, S, S) each."""
    return [channels_first(image, size) for image in decode_image(stored)]


def labelled_answers(path: str | Path, labels: int) -> tuple[Array, Array]:
    """Read images and answers of the first labelled questions of a training file.

    Returns stored images, (labels, 1 + A, H, W, 3), and which answer is right, (labels,).
    Raises as `QuestionsFile`, and SpecError where there are fewer.
    """
    if len(parts(path)) < 2:
        raise SpecError(path, "no training questions", "a training file such as iqtt-train.h5")
    with open_questions(path, "labeled") as questions:
        known = len(questions) if questions.has_answers else 0
        if not 1 <= labels <= known:
            raise SpecError("labels", labels, f"0 to {known}, as many as the file has")
        rows = slice(0, labels)
        return questions.read("questions", rows), questions.read("answers", rows)
