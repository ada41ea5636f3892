"""Where the cameras of a scene are."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenegen.camera import look_at
from scenegen.common.random.seeding import Purpose, item_numbers
from scenegen.description.specs import DatasetSpec, Request
from scenegen.sampling.octant import octant_points

Array = NDArray[Any]


def sample_cameras(spec: DatasetSpec, index: Array) -> Array:
    """Draw where the cameras of items `index`, (N,), are: (N, V, 3), world.

    The input view is turned about the vertical axis through the target for the other views. One
    view is uniform by area on the positive octant. Several views stay in the octant, where no wall
    hides the room: the input view lies near one side of it, left or right with equal chance, so
    that the widest turn towards the other side fits. Its height and its azimuth within that span
    are uniform.
    """
    height, turn, side = item_numbers(spec.seed, index, Purpose.CAMERA, count=3).T
    widest = spec.views[-1] / 360
    azimuth = (turn * (0.25 - widest))[:, None] + np.array(spec.views) / 360  # in full turns
    mirrored = (side < 0.5) & (widest > 0)
    azimuth = np.where(mirrored[:, None], 0.25 - azimuth, azimuth)
    return octant_points(spec.camera_target, spec.camera_radius, height[:, None], azimuth)


def with_right_eyes(spec: Request, position: Array, target: Array) -> tuple[Array, Array]:
    """Return positions and targets of cameras, (..., V, 3), with those of stereo pairs.

    Each camera is then followed by one that is moved along its x axis, (..., 2 V, 3).
    """
    if not spec.stereo:
        return position, target
    across = spec.stereo * look_at(position, target)[..., :3, 0]
    shape = (*position.shape[:-2], -1, 3)
    position, target = (
        np.stack([values, values + across], axis=-2).reshape(shape) for values in (position, target)
    )
    return position, target


def sample_fov_y(spec: DatasetSpec, index: Array) -> Array:
    """Draw the vertical fields of view of the cameras of items `index`, (N,), in degrees: (N,)."""
    wider = item_numbers(spec.seed, index, Purpose.CAMERA, start=4, count=1)[:, 0]
    fov = spec.fov_degrees + spec.fov_spread_degrees * wider
    return np.array([spec.fov_y(f) for f in fov.tolist()])
