"""From questions to batches for the renderer: every cube becomes a box of `scenegen`."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iqtt.questions.distractors import Shapes
from iqtt.questions.specs import SplitSpec
from iqtt.shapes.polycube import box_centre
from scenegen.common.rotations import product
from scenegen.objects.basic_shapes import unit_shape
from scenegen.rendering.packing import SceneBatch

Array = NDArray[Any]
CUBE_SCALE = math.sqrt(3) / 2  # the unit box has bounding radius 1, so edge 2 / sqrt(3)


@dataclass(frozen=True, eq=False)
class Question:
    """A question ready to render: its shapes, and the rotation and lights of each image.

    Attributes:
        index: row of the question in its split.
        attempt: how many choices of shapes were given up before this one.
        shapes: shapes of the reference and the answers.
        camera_distance: from the camera of all its images to the world's origin, cube edges.
        world_from_shape: rotations about the shapes' box centres, which lie at the world's origin,
            (1 + K, 3, 3) for K answers.
        light_position: world, cube edges, (1 + K, L, 3); zero in unused slots.
        light_color: radiance, RGB, (1 + K, L, 3); zero in unused slots.
        light_count: number of lights of each image, (1 + K,).
        angle_degrees: smallest rotation from the reference's view to the right answer's.
    """

    index: int
    attempt: int
    shapes: Shapes
    camera_distance: float
    world_from_shape: Array
    light_position: Array
    light_color: Array
    light_count: Array
    angle_degrees: float


def cube_centres(shapes: Sequence[Array], slots: int) -> Array:
    """Return the centres of each shape's cubes about its box centre, (S, slots, 3), cube edges.

    Args:
        shapes: (n, 3) integers each; rows of the result beyond a shape's n are zero.
        slots: largest number of cubes.
    """
    counts = np.array([len(cubes) for cubes in shapes])
    centres = np.zeros((len(shapes), slots, 3))
    for count in np.unique(counts).tolist():
        rows = np.flatnonzero(counts == count)
        cubes = np.stack([shapes[i] for i in rows.tolist()])
        # A cube at integer c fills [c, c + 1], so its centre is half an edge further.
        centres[rows, :count] = cubes + 0.5 - box_centre(cubes)[:, None]
    return centres


def pack_questions(spec: SplitSpec, questions: Sequence[Question]) -> SceneBatch:
    """Return a batch with all images of each question, one question after another."""
    render_spec = spec.render_spec()
    shapes = [cubes for question in questions for cubes in question.shapes.cubes]
    centres = cube_centres(shapes, render_spec.object_slots)
    counts = np.array([len(cubes) for cubes in shapes])
    world_from_shape = np.concatenate([question.world_from_shape for question in questions])
    distances = [question.camera_distance for question in questions]
    batch, slots = centres.shape[:2]
    used = np.arange(slots) < counts[:, None]
    world_from_object = np.zeros((batch, slots, 4, 4))
    world_from_object[..., :3, :3] = CUBE_SCALE * world_from_shape[:, None]
    world_from_object[..., :3, 3] = product(centres, np.swapaxes(world_from_shape, 1, 2))
    world_from_object[..., 3, 3] = 1.0
    world_from_object[~used] = 0.0
    reflectance = np.zeros((batch, 1 + slots, 3))
    reflectance[:, 1:][used] = spec.reflectance
    world_from_camera = np.tile(np.eye(4), (batch, 1, 1))
    world_from_camera[:, 2, 3] = np.repeat(distances, 1 + spec.answers)
    light_count = np.concatenate([question.light_count for question in questions])
    return SceneBatch(
        spec=render_spec,
        names=render_spec.shapes,
        shape_of=unit_shape,
        index=np.zeros(batch, np.int64),
        view=np.zeros(batch, np.int32),
        world_from_camera=world_from_camera,
        fov_y_degrees=np.full(batch, spec.fov_y_degrees),
        object_count=counts.astype(np.int32),
        light_count=light_count.astype(np.int32),
        shape=np.where(used, 0, -1).astype(np.int8),
        world_from_object=world_from_object,
        object_scale=np.where(used, CUBE_SCALE, 0.0),
        reflectance=reflectance,
        gloss=np.zeros((*reflectance.shape[:2], 2)),
        light_position=np.concatenate([question.light_position for question in questions]),
        light_color=np.concatenate([question.light_color for question in questions]),
        ambient=np.tile(spec.ambient, (batch, 1)),
        attenuation=np.tile((0.0, 1.0), (batch, 1)),
        has_room=np.zeros(batch, bool),
        background=np.tile(spec.background, (batch, 1)),
        cubes_only=True,
    )
