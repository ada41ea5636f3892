"""Images of polycubes: from cubes, rotations and lights to batches for the renderer."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iqtt.polycube import box_centre
from iqtt.questions import Shapes
from iqtt.specs import SplitSpec
from scenegen.packing import SceneBatch
from scenegen.specs import DatasetSpec

Array = NDArray[Any]
CUBE_SCALE = math.sqrt(3) / 2  # the unit box has bounding radius 1, so edge 2 / sqrt(3)


@dataclass(frozen=True, eq=False)
class View:
    """One image of a shape.

    Attributes:
        cubes: (n, 3) integers.
        world_from_shape: rotation about the shape's box centre, which lies at the world's origin,
            (3, 3).
        light_position, light_color: (L, 3), world, cube edges; zero in unused slots.
        light_count: number of lights used.
    """

    cubes: Array
    world_from_shape: Array
    light_position: Array
    light_color: Array
    light_count: int


@dataclass(frozen=True, eq=False)
class Question:
    """A question ready to render: its shapes, and the reference's and the answers' views."""

    index: int
    attempt: int
    shapes: Shapes
    views: tuple[View, ...]
    angle_degrees: float


def pack_views(spec: SplitSpec, render_spec: DatasetSpec, views: Sequence[View]) -> SceneBatch:
    """Return a batch with one image for each view; `render_spec` says how large."""
    batch, slots = len(views), render_spec.object_slots
    counts = np.array([len(view.cubes) for view in views], np.int32)
    used = np.arange(slots) < counts[:, None]
    rotations = np.stack([view.world_from_shape for view in views])
    centers = np.zeros((batch, slots, 3))
    # Box centres by number of cubes at once; a cube's own centre is half an edge from its corner.
    for size in np.unique(counts).tolist():
        rows = np.flatnonzero(counts == size).tolist()
        cubes = np.stack([views[i].cubes for i in rows])
        local = cubes + 0.5 - box_centre(cubes)[:, None]
        centers[rows, :size] = local @ np.swapaxes(rotations[rows], 1, 2)
    world_from_object = np.zeros((batch, slots, 4, 4))
    world_from_object[..., :3, :3] = CUBE_SCALE * rotations[:, None]
    world_from_object[..., :3, 3] = centers
    world_from_object[..., 3, 3] = 1.0
    world_from_object[~used] = 0.0
    reflectance = np.zeros((batch, 1 + slots, 3))
    reflectance[:, 1:][used] = spec.reflectance
    camera = spec.camera
    return SceneBatch(
        spec=render_spec,
        world_from_camera=np.repeat(camera.world_from_camera[None], batch, axis=0),
        fov_y_degrees=np.full(batch, camera.fov_y_degrees),
        object_count=counts,
        light_count=np.array([view.light_count for view in views], np.int32),
        shape=np.where(used, 0, -1).astype(np.int8),
        world_from_object=world_from_object,
        object_scale=np.where(used, CUBE_SCALE, 0.0),
        reflectance=reflectance,
        light_position=np.stack([view.light_position for view in views]),
        light_color=np.stack([view.light_color for view in views]),
        ambient=np.tile(spec.ambient, (batch, 1)),
        attenuation=np.tile((0.0, 1.0), (batch, 1)),
        has_room=np.zeros(batch, bool),
        background=np.tile(spec.background, (batch, 1)),
    )
