"""Guesses at what the first view of a scene does not show, by which no shape is known.

Each object that counts in the first view becomes a ball or a block. Both guesses are told the true
mask and the true depth there, and the empty room. What they lack is shape, so they are a floor for
methods that were shown the first view alone.

- balls: a ball takes as many pixels as its object. Its centre lies on the mean ray of these. Its
  surface has the object's median depth on average, which puts the centre by two thirds of its
  radius behind that.
- blocks: an upright block with the walls' directions stands on the floor. It is as high as the
  object's highest visible point. It is as wide as deep, so that it looks as wide as the object on
  average: the mean width of a turned square is 4 / pi of its side. Its middle is the ball's.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from metrics.measures.objects import counted_objects
from scenegen.camera import Lens, back_project, pixel_directions, pixel_size, transform_points

Array = NDArray[Any]


def balls_and_blocks(
    depth: Array, object_id: Array, world_from_camera: Array, lens: Lens
) -> tuple[Array, Array]:
    """Return balls (K, 4), centre and radius, and blocks (K, 2, 3), ends, of a view's objects.

    All in the world's frame and scene units; the view's depth and ids are (H, W).
    """
    height, width = depth.shape
    rays, points = (
        pixel_directions(height, width, lens),
        back_project(depth, lens),
    )
    ids = np.where(counted_objects(object_id), object_id, 0)
    balls, blocks = np.empty((0, 4)), np.empty((0, 2, 3))
    for number in np.unique(ids[ids > 0]).tolist():
        own = ids == number
        slope = np.sqrt(np.count_nonzero(own) / np.pi) * pixel_size(height, lens)
        away = float(np.median(depth[own])) / (1.0 - min(slope, 1.0) * 2.0 / 3.0)
        middle = transform_points(world_from_camera, rays[own].mean(axis=0) * away)
        seen = transform_points(world_from_camera, points[own])
        half = np.pi / 8.0 * float(np.ptp(seen @ world_from_camera[:3, 0]))
        x, _, z = middle
        block = [(x - half, 0.0, z - half), (x + half, seen[:, 1].max(), z + half)]
        balls = np.append(balls, [[*middle, slope * away]], axis=0)
        blocks = np.append(blocks, [block], axis=0)
    return balls, blocks


def depth_of_balls(balls: Array, world_from_camera: Array, lens: Lens, room: Array) -> Array:
    """Return planar depth (H, W) of balls (K, 4) before a room of depth (H, W)."""
    depth, (height, width) = room, room.shape
    rays = pixel_directions(height, width, lens)
    square = (rays * rays).sum(axis=-1)
    centres = (balls[:, :3] - world_from_camera[:3, 3]) @ world_from_camera[:3, :3]
    for centre, radius in zip(centres, balls[:, 3].tolist(), strict=True):
        along = rays @ centre
        inside = along * along - square * (centre @ centre - radius * radius)
        hit = (along - np.sqrt(np.maximum(inside, 0.0))) / square
        depth = np.where((inside > 0.0) & (hit > 0.0), np.minimum(depth, hit), depth)
    return depth


def depth_of_blocks(blocks: Array, world_from_camera: Array, lens: Lens, room: Array) -> Array:
    """Return planar depth (H, W) of blocks (K, 2, 3) before a room of depth (H, W)."""
    height, width = room.shape
    rays = pixel_directions(height, width, lens) @ world_from_camera[:3, :3].T
    rays = np.where(np.abs(rays) < 1e-12, 1e-12, rays)
    depth, origin = room, world_from_camera[:3, 3]
    for low, high in blocks:
        one, other = (low - origin) / rays, (high - origin) / rays
        enters = np.minimum(one, other).max(axis=-1)
        leaves = np.maximum(one, other).min(axis=-1)
        hit = (enters > 0.0) & (enters < leaves)
        depth = np.where(hit, np.minimum(depth, enters), depth)
    return depth
