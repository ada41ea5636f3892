"""The lights of the images of a question, drawn anew for each image."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iqtt.questions.packing import cube_centres
from iqtt.questions.specs import SplitSpec
from scenegen.common.rotations import cos_sin

Array = NDArray[Any]
Lights = tuple[Array, Array, Array]  # positions and colours, (I, L, 3) each, and numbers, (I,)
LIGHT_DISTANCE = 4  # camera distances from a light to the origin: near parts are hardly brighter
# Cosines of the angles to the camera of the first light and of the others.
FIRST_LIGHT, OTHER_LIGHTS = (0.7, 0.9), (0.0, 0.8)
FACE_STEPS = 8  # of 255: by so much the colours of two directions of faces differ in some channel
ATTEMPTS = 50  # draws of the lights of one image
_NORMALS = np.concatenate([np.eye(3), -np.eye(3)])
# The corners of a cube's six faces about its centre, (6, 4, 3).
_CORNERS = np.array([
    [[*np.roll((side, a, b), axis)] for a in (-1, 1) for b in (-1, 1)]
    for side in (1, -1) for axis in range(3)
]) / 2  # fmt: skip


def draw_lights(
    spec: SplitSpec, rng: np.random.Generator, cubes: Array, turns: Array, camera_distance: float
) -> Lights | None:
    """Draw lights under which the faces of cubes differ; None where an image has no such ones.

    Args:
        cubes: of the shape in each image, (I, n, 3) integers.
        turns: rotations world_from_shape, (I, 3, 3).
        camera_distance: from the camera to the world's origin, cube edges.
    """
    centres = cube_centres(list(cubes), cubes.shape[1])
    lights = propose_lights(spec, rng, len(cubes), camera_distance)
    left = np.arange(len(cubes))
    for _ in range(ATTEMPTS):
        seen = centres[left], turns[left], camera_distance
        left = left[~faces_differ(spec, *seen, *(values[left] for values in lights[:2]))]
        if not len(left):
            return lights
        proposed = propose_lights(spec, rng, len(left), camera_distance)
        for values, new in zip(lights, proposed, strict=True):
            values[left] = new
    return None


def propose_lights(
    spec: SplitSpec, rng: np.random.Generator, images: int, camera_distance: float
) -> Lights:
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
    cosine, sine = cos_sin(around / (2 * math.pi))
    direction = np.stack([r * cosine, r * sine, z], axis=2)
    color = rng.uniform(0.3, 1.0, (images, most, 3))
    level = spec.light_level * distance**2 / count
    color *= level[:, None, None] / color.max(axis=2, keepdims=True)
    used = (np.arange(most) < count[:, None])[..., None]
    return np.where(used, distance * direction, 0.0), np.where(used, color, 0.0), count


def faces_differ(
    spec: SplitSpec, centres: Array, turns: Array, camera_distance: float,
    position: Array, color: Array,
) -> Array:  # fmt: skip
    """Return whether directions of faces have colours FACE_STEPS of 255 apart in each image, (I,).

    All faces that are turned to the camera count, also where a cube hides them. The ranges of the
    colours of two directions lie apart in one channel, so that it does not matter which faces meet
    in the picture.

    Args:
        centres: of the cubes, about the world's origin but in the shape's frame, (I, n, 3).
    """
    eye = camera_distance * turns[:, 2]
    facing = (_NORMALS @ eye[..., None]) > _NORMALS @ centres.swapaxes(1, 2) + 0.5  # (I, 6, n)
    image, side = np.nonzero(facing.any(axis=2))  # R directions
    points = centres[image, :, None] + _CORNERS[side, None]  # (R, n, 4, 3)
    lit = color.any(axis=2, keepdims=True)  # unused slots lie at the origin
    position = np.where(lit, position, [0.0, 0.0, LIGHT_DISTANCE * camera_distance])
    x, y, z = np.moveaxis((position @ turns)[image, None, None] - points[..., None, :], -1, 0)
    axis, sign = side[:, None, None, None] % 3, np.where(side < 3, 1.0, -1.0)
    along = sign[:, None, None, None] * np.choose(axis, (x, y, z))
    square = x * x + y * y + z * z
    fall = np.maximum(along, 0.0) / (square * np.sqrt(square))
    light = fall @ color[image, None] + spec.ambient
    shown = np.clip(255 * np.array(spec.reflectance) * light, 0, 255).reshape(len(image), -1, 3)
    unseen = ~np.repeat(facing[image, side], 4, axis=1)[..., None]
    low, high = np.full((len(turns), 6, 3), np.inf), np.full((len(turns), 6, 3), -np.inf)
    low[image, side] = np.where(unseen, np.inf, shown).min(axis=1)
    high[image, side] = np.where(unseen, -np.inf, shown).max(axis=1)
    above = (low[:, :, None] - high[:, None]).max(axis=-1)
    apart = np.maximum(above, above.swapaxes(1, 2)) >= FACE_STEPS
    return np.asarray((apart | np.eye(6, dtype=bool)).all(axis=(1, 2)))
