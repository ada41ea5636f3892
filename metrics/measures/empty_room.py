"""The empty room: what a camera would see if the room held no object."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.camera import pixel_directions

Array = NDArray[Any]


def empty_room(
    world_from_camera: Array, fov_y_degrees: float, height: int, width: int
) -> tuple[Array, Array]:
    """Return planar depth, (H, W), and normals, (H, W, 3), of the room's floor and two walls.

    Depth is in scene units and normals are in the camera frame. The planes are continued beyond
    the room's edges, so that every pixel has a depth.

    Args:
        world_from_camera: rigid transform of the camera, (4, 4).
        fov_y_degrees: vertical field of view.
    """
    rays = pixel_directions(height, width, fov_y_degrees)
    directions, origin = rays @ world_from_camera[:3, :3].T, world_from_camera[:3, 3]
    with np.errstate(divide="ignore", over="ignore"):
        reach = np.where((directions < 0) & (origin > 0), -origin / directions, np.inf)
    depth = reach.min(axis=-1)
    depth = np.where(np.isfinite(depth), depth, depth[np.isfinite(depth)].max(initial=1.0))
    return depth, np.eye(3)[reach.argmin(axis=-1)] @ world_from_camera[:3, :3]
