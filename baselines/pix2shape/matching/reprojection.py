"""Reprojection: what another image of a scene shows at the points that this image's pixels see.

If the depth is right, and the point not hidden from the other camera, both show the same colour:
matte surfaces under fixed lights look the same from everywhere. That is what learning depth from
several views rests on (Zhou et al. 2017; Godard et al. 2019).
"""

import math

import torch
from torch import Tensor
from torch.nn import functional

from baselines.pix2shape.network.empty_rooms import Cameras, rays

NEAR = 0.05  # scene units; points nearer to the other camera than this, or behind it, are not seen


def reprojected(
    values: Tensor, others: Cameras, depth: Tensor, cameras: Cameras
) -> tuple[Tensor, Tensor, Tensor]:
    """Return other images' values at surface points, the points' depths there, and which are shown.

    Args:
        values: of the other cameras' images, (B, C, S, S).
        depth: D depths for each pixel of the images of `cameras`, planar, scene units,
            (B, D, S, S).

    Returns:
        Bilinear values, (B, C, D, S, S), planar depths, (B, D, S, S), and a mask of the points that
        lie within these images, (B, D, S, S). Whether something stands between
        a point and the other camera is not asked.
    """
    batch, count, size, _ = depth.shape
    other_from_camera = torch.linalg.solve(others.world_from_camera, cameras.world_from_camera)
    toward = other_from_camera[:, :3, :3] @ rays(size, cameras.fov_y_degrees, depth).flatten(1)
    points = (
        toward[:, :, None] * depth.flatten(2)[:, None] + other_from_camera[:, :3, 3, None, None]
    )
    away = -points[:, 2]
    edge = math.tan(math.radians(others.fov_y_degrees) / 2) * away.clamp(min=NEAR)
    place = torch.stack([points[:, 0], -points[:, 1]], dim=3) / edge[..., None]
    shown = functional.grid_sample(values, place, padding_mode="border", align_corners=False)
    seen = (place.abs() < 1).all(dim=3) & (away > NEAR)
    shape = (batch, count, size, size)
    return shown.view(batch, -1, count, size, size), away.view(shape), seen.view(shape)
