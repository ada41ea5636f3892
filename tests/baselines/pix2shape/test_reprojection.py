"""A textured plane seen by two cameras: with the right depth one image gives the other."""

import math

import numpy as np
import torch

from baselines.pix2shape.matching import reprojected
from baselines.pix2shape.network.empty_rooms import Cameras
from scenegen.camera import Camera, pixel_directions

FOV, SIZE = 30.0, 64
POSES = [
    Camera((0.5 + 1.5 * math.sin(turn), 0.6, 0.2 + 1.5 * math.cos(turn)), (0.5, 0.4, 0.2), FOV)
    for turn in (0.0, math.radians(8))
]


def seen(camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """Return image, (S, S, 3), and depth of the plane z = 0 whose colour varies smoothly."""
    pose = camera.world_from_camera
    rays = pixel_directions(SIZE, SIZE, FOV) @ pose[:3, :3].T
    depth = -pose[2, 3] / rays[..., 2]
    x, y, _ = np.moveaxis(pose[:3, 3] + depth[..., None] * rays, -1, 0)
    image = np.stack([np.sin(9 * x), np.cos(7 * y), np.sin(5 * (x + y))], axis=-1)
    return 0.5 + 0.4 * image, depth


def batched(array: np.ndarray) -> torch.Tensor:
    return torch.tensor(array, dtype=torch.float64)[None]


def reprojection(depth: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the second image seen through the first one's depth, and where it shows it."""
    other = batched(np.moveaxis(seen(POSES[1])[0], -1, 0))
    cameras = [Cameras(batched(camera.world_from_camera), FOV) for camera in POSES]
    found, _, inside = reprojected(other, cameras[1], batched(depth)[:, None], cameras[0])
    return np.moveaxis(found[0, :, 0].numpy(), 0, -1), inside[0, 0].numpy()


def test_the_true_depth_gives_the_same_image():
    image, depth = seen(POSES[0])
    found, inside = reprojection(depth)
    assert 0.8 < inside.mean() < 1
    inner = inside & np.roll(inside, 1, axis=1) & np.roll(inside, -1, axis=1)
    inner[:2] = inner[-2:] = False  # the outermost half pixel is not interpolated
    assert np.abs(found - image)[inner].max() < 2e-3


def test_points_behind_the_other_camera_are_not_seen():
    """Points near the axis of a camera that looks away would fall into its image."""
    image, depth = (batched(array) for array in seen(POSES[0]))
    pose = batched(POSES[0].world_from_camera)
    turned = pose @ torch.diag(torch.tensor([-1.0, 1.0, -1.0, 1.0], dtype=torch.float64))
    values = image.movedim(3, 1)
    for other, expected in ((pose, True), (turned, False)):
        found, _, inside = reprojected(
            values, Cameras(other, FOV), depth[:, None], Cameras(pose, FOV)
        )
        assert bool(inside[0, 0, 31:33, 31:33].all()) is expected
        assert bool(inside.any()) is expected
        assert found.isfinite().all()
