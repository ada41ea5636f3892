"""Where the cameras of a scene are."""

import math

from scenegen.camera import Camera
from scenegen.common.seeding import Purpose, item_rng
from scenegen.description.specs import DatasetSpec
from scenegen.sampling.octant import around, octant_point


def sample_cameras(spec: DatasetSpec, index: int) -> tuple[Camera, ...]:
    """Draw the input view of item `index`, and turn it about the vertical axis for the other views.

    The axis goes through the target. One view is uniform by area on the positive octant. Several
    views stay in the octant, where no wall hides the room: the input view lies near one side of it,
    left or right with equal chance, so that the widest turn towards the other side fits. Its height
    and its azimuth within that span are uniform.
    """
    rng = item_rng(spec.seed, index, Purpose.CAMERA)
    height, turn = (float(x) for x in rng.random(2))
    widest = math.radians(spec.views[-1])
    first = turn * (math.pi / 2 - widest)
    mirrored = widest > 0 and bool(rng.random() < 0.5)
    cameras = []
    for degrees in spec.views:
        azimuth = first + math.radians(degrees)
        direction = octant_point(height, math.pi / 2 - azimuth if mirrored else azimuth)
        position = around(spec.camera_target, spec.camera_radius, direction)
        cameras.append(Camera(position, spec.camera_target, spec.fov_y_degrees))
    return tuple(cameras)
