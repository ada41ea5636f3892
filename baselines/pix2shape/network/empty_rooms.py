"""What is known of every room before an image is seen: where rays enter and leave its box."""

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from baselines.pix2shape.network.surfels import pixel_rays

NEAREST = 0.4  # scene units; no ray is said to enter the room nearer to its camera
CLOSEST = 0.1  # metres; the same of closed rooms, whose cameras stand inside
FLAT = 0.02  # scene units; what stands out less is said to be floor or wall
DEEPEST = 0.95  # of a ray's depth in the empty room; it enters the room before that


@dataclass(frozen=True, eq=False)
class Cameras:
    """The cameras of B images.

    Attributes:
        world_from_camera: (B, 4, 4).
        fov_y_degrees: vertical angle of view: a number for all, or (B,).
        room_size: inner size of closed rooms, metres, (B, 3), infinite for the paper's room; None
            where all are the paper's.
    """

    world_from_camera: Tensor
    fov_y_degrees: float | Tensor
    room_size: Tensor | None = None

    @property
    def edge(self) -> float | Tensor:
        """The room's longest edge, (B, 1, 1), or a number for all; 1 of the paper's room.

        Networks are told lengths, and give relief, in this unit.
        """
        if self.room_size is None:
            return 1.0
        edge = self.room_size.amax(dim=1)[:, None, None]
        return torch.where(edge.isfinite(), edge, 1.0)


def half_slope(fov_y_degrees: float | Tensor) -> float | Tensor:
    """Return the tangent of half the angle of view, a number or (B, 1, 1)."""
    if isinstance(fov_y_degrees, Tensor):
        return torch.tan(torch.deg2rad(fov_y_degrees) / 2)[:, None, None]
    return math.tan(math.radians(fov_y_degrees) / 2)


def rays(size: int, fov_y_degrees: float | Tensor, like: Tensor) -> Tensor:
    """Return the rays (x, y, -1) through the pixels' centres, camera frame, (3, S, S).

    They are (B, 3, S, S) where each camera has its own angle of view.
    """
    if isinstance(fov_y_degrees, Tensor):
        x, y = (axis * half_slope(fov_y_degrees) for axis in pixel_rays(size, size, 90.0, like))
    else:
        x, y = pixel_rays(size, size, fov_y_degrees, like)
    across, down = (axis.expand(*axis.shape[:-2], size, size) for axis in (x, y))
    return torch.stack([across, down, -torch.ones_like(across)], dim=-3)


def empty_rooms(
    world_from_camera: Tensor,
    fov_y_degrees: float | Tensor,
    size: int,
    room_size: Tensor | None = None,
) -> tuple[Tensor, Tensor, Tensor]:
    """Return what cameras see of rooms without objects.

    Args:
        world_from_camera: (B, 4, 4).
        fov_y_degrees, room_size: as of `Cameras`.
        size: S, pixels a side.

    Returns:
        depth: planar, scene units, (B, S, S), of the nearest of floor and two walls. The planes
            are continued beyond the room, as in the baseline empty-room. Of a closed room, the
            nearest of floor, ceiling and four walls.
        entry: depth at which each ray enters the unit box, (B, S, S), between NEAREST and DEEPEST
            of `depth`; every object lies behind it. In a closed room, CLOSEST or DEEPEST.
        points: where rays meet floor and walls, world frame, (B, 3, S, S).
    """
    origin = world_from_camera[:, :3, 3, None]  # (B, 3, 1)
    ahead = rays(size, fov_y_degrees, world_from_camera).flatten(-2)
    with torch.autocast(ahead.device.type, enabled=False):  # bfloat16 moves walls by 0.01
        toward = world_from_camera[:, :3, :3] @ ahead
    falling = toward < 0
    steps = torch.where(falling, toward, -1.0)
    reach = torch.where(falling & (origin > 0), -origin / steps, torch.inf)
    if room_size is not None:
        far, rising = room_size[:, :, None], toward > 0
        beyond_far = (far - origin) / torch.where(rising, toward, 1.0)
        reach = torch.where(rising & (origin < far), beyond_far, reach)
    leaving = reach.amin(dim=1)
    farthest = leaving.masked_fill(~leaving.isfinite(), 0).amax(dim=1, keepdim=True)
    beyond = torch.where(farthest > 0, farthest, 1.0)  # of rays that meet no plane
    depth = torch.where(leaving.isfinite(), leaving, beyond)
    entering = torch.where(falling, (1 - origin) / steps, 0.0).amax(dim=1)
    entry = entering.clamp(min=NEAREST)
    if room_size is not None:
        entry = torch.where(room_size.isfinite().all(dim=1, keepdim=True), CLOSEST, entry)
    entry = torch.minimum(entry, DEEPEST * depth)
    points = origin + toward * depth[:, None]
    shape = (len(depth), size, size)
    return depth.view(shape), entry.view(shape), points.view(-1, 3, size, size)


def planes_of(cameras: Cameras, size: int) -> Tensor:
    """Return what a network is told of each pixel's ray: where it meets floor or wall, and how far.

    (B, RAY_PLANES, S, S), of values about -1 to 1, or -3 to 2 in closed rooms.
    """
    depth, _, points = empty_rooms(
        cameras.world_from_camera, cameras.fov_y_degrees, size, cameras.room_size
    )
    told = torch.cat([points, depth[:, None]], dim=1)
    if cameras.room_size is not None:
        told = told / torch.as_tensor(cameras.edge)[:, None]
    return torch.cat([2 * told[:, :3] - 0.5, 2 * told[:, 3:] - 3], dim=1)
