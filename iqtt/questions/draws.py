"""From which side an image shows its shape, and in what light: random rotations and lights."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iqtt.questions.specs import SplitSpec
from iqtt.shapes.polycube import ROTATIONS
from scenegen.common.rotations import rotation_matrix

Array = NDArray[Any]
FIRST_LIGHT_COSINE = 0.5  # of the widest angle between the first light and the camera


def rotation_angle_degrees(a: Array, b: Array, symmetric: Array) -> float:
    """Return the angle of the smallest rotation from view a to view b of a shape, degrees.

    Args:
        a, b: world from shape rotations, (3, 3).
        symmetric: which of ROTATIONS leave the shape as it is, (24,) bool; they make some
            rotations invisible.
    """
    # The trace of b g^T a^T, for g ranging over the shape's symmetries.
    traces = ROTATIONS[symmetric].reshape(-1, 9) @ (a.T @ b).ravel()
    return math.degrees(math.acos(min(1.0, max(-1.0, (float(traces.max()) - 1) / 2))))


def draw_rotations(rng: np.random.Generator, shape: tuple[int, ...]) -> Array:
    """Draw rotations uniform on SO(3), (*shape, 3, 3)."""
    quaternion = rng.standard_normal((4, *shape))
    return rotation_matrix(quaternion / np.sqrt((quaternion * quaternion).sum(axis=0)))


def draw_lights(
    spec: SplitSpec, rng: np.random.Generator, images: int
) -> tuple[Array, Array, Array]:
    """Draw light positions and colours, (images, L, 3) each, and their numbers, (images,).

    They are uniform on a sphere around the shape; the first one only where it is within 60 degrees
    of the camera, so that what the camera sees is lit. Unused slots are zero.
    """
    most, distance = spec.lights[1], spec.light_distance
    count = rng.integers(spec.lights[0], most, images, endpoint=True)
    # Uniform in z and in the angle around it is uniform on the sphere, and on its caps.
    z = rng.uniform(-1.0, 1.0, (images, most))
    z[:, 0] = FIRST_LIGHT_COSINE + (1 - FIRST_LIGHT_COSINE) * (z[:, 0] + 1) / 2
    around = rng.uniform(0.0, 2 * math.pi, (images, most))
    r = np.sqrt(1 - z * z)
    direction = np.stack([r * np.cos(around), r * np.sin(around), z], axis=2)
    color = rng.uniform(0.5, 1.0, (images, most, 3))
    level = spec.light_level * distance**2 / count
    color *= level[:, None, None] / color.max(axis=2, keepdims=True)
    used = (np.arange(most) < count[:, None])[..., None]
    return np.where(used, distance * direction, 0.0), np.where(used, color, 0.0), count
