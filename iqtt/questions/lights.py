"""The lights of the images of a question, drawn anew for each image."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iqtt.questions.specs import SplitSpec

Array = NDArray[Any]
LIGHT_DISTANCE = 4  # camera distances from a light to the origin: near parts are hardly brighter
# Cosines of the angles to the camera of the first light and of the others.
FIRST_LIGHT, OTHER_LIGHTS = (0.7, 0.9), (0.0, 0.8)


def draw_lights(
    spec: SplitSpec, rng: np.random.Generator, images: int, camera_distance: float
) -> tuple[Array, Array, Array]:
    """Draw light positions and colours, (images, L, 3) each, and their numbers, (images,).

    They are far away, on the camera's side, in uniform directions within bounds: the first at an
    angle of 26 to 46 degrees to the camera, so that most of what it sees is lit and the faces of a
    cube differ; the others at 37 to 90 degrees, on the other side of the camera. Unused slots
    are zero.
    """
    most, distance = spec.lights[1], LIGHT_DISTANCE * camera_distance
    count = rng.integers(spec.lights[0], most, images, endpoint=True)
    # A uniform z and a uniform angle about the z axis are uniform on a zone of the sphere.
    z = rng.uniform(*OTHER_LIGHTS, (images, most))
    z[:, 0] = rng.uniform(*FIRST_LIGHT, images)
    around = rng.uniform(0.0, 2 * math.pi, (images, most))
    around[:, 1:] = around[:, :1] + math.pi / 2 + around[:, 1:] / 2
    r = np.sqrt(1 - z * z)
    direction = np.stack([r * np.cos(around), r * np.sin(around), z], axis=2)
    color = rng.uniform(0.3, 1.0, (images, most, 3))
    level = spec.light_level * distance**2 / count
    color *= level[:, None, None] / color.max(axis=2, keepdims=True)
    used = (np.arange(most) < count[:, None])[..., None]
    return np.where(used, distance * direction, 0.0), np.where(used, color, 0.0), count
