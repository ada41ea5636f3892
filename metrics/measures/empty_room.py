"""The empty room: what a camera would see if the room held no object."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.camera import pixel_directions

Array = NDArray[Any]


def empty_room(
    world_from_camera: Array,
    fov_y_degrees: float,
    height: int,
    width: int,
    room_size: Array | None = None,
) -> tuple[Array, Array]:
    """Return planar depth, (H, W), and normals, (H, W, 3), of the room's floor and two walls.

    Depth is in scene units and normals are in the camera frame. The planes are continued beyond
    the room's edges, so that every pixel has a depth. A closed room has a ceiling and four walls;
    its windows count as wall, as what is outside has no depth.

    Args:
        world_from_camera: rigid transform of the camera, (4, 4).
        fov_y_degrees: vertical field of view.
        room_size: of a closed room, (3,); None for the paper's room.
    """
    lines = pixel_directions(height, width, fov_y_degrees)
    reach = _reach(lines, world_from_camera, room_size)
    axis = np.eye(3)[reach.argmin(axis=-1)]
    if room_size is not None:
        axis = np.where(lines @ world_from_camera[:3, :3].T > 0, -axis, axis)
    return _least(reach), axis @ world_from_camera[:3, :3]


def depth_along(lines: Array, world_from_camera: Array, room_size: Array | None = None) -> Array:
    """Return planar depth (N,) of the same planes along lines (N, 3), camera frame, z = -1."""
    return _least(_reach(lines, world_from_camera, room_size))


def _reach(lines: Array, world_from_camera: Array, room_size: Array | None) -> Array:
    """Return planar depth of the plane of each axis along lines, (..., 3)."""
    directions, origin = lines @ world_from_camera[:3, :3].T, world_from_camera[:3, 3]
    with np.errstate(divide="ignore", over="ignore"):
        reach: Array = np.where((directions < 0) & (origin > 0), -origin / directions, np.inf)
        if room_size is not None:
            far = (room_size - origin) / directions
            reach = np.where((directions > 0) & (origin < room_size), far, reach)
    return reach


def _least(reach: Array) -> Array:
    """Return the nearest plane's depth; where a line meets none, the farthest that others meet."""
    depth = reach.min(axis=-1)
    return np.asarray(
        np.where(np.isfinite(depth), depth, depth[np.isfinite(depth)].max(initial=1.0))
    )
