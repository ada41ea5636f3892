"""The transformer against analytic truth: balls and boxes under known cameras, and gradients."""

import numpy as np
import pytest
import torch

from baselines.ptn.projection import first_hit, outward, sampled, silhouettes
from scenegen.camera import Camera, pixel_directions

torch.set_num_threads(1)
BOX = torch.tensor([[-1.0, -0.5, -1.0], [1.0, 0.5, 1.0]])  # voxels that are no cubes
CAMERA = Camera((1.8, 1.5, 2.2), (0.0, 0.0, 0.0), 34.0)
RADIUS, SIZE, VOXELS = 0.42, 96, 32


def centres(count=VOXELS):
    """Return the centres of voxels, (count, count, count, 3), indexed by z, y and x."""
    unit = (np.arange(count) + 0.5) / count
    z, y, x = np.meshgrid(unit, unit, unit, indexing="ij")
    low, high = BOX.numpy()
    return low + np.stack([x, y, z], axis=-1) * (high - low)


def camera_rays():
    pose = CAMERA.world_from_camera
    directions = pixel_directions(SIZE, SIZE, CAMERA.fov_y_degrees).reshape(-1, 3) @ pose[:3, :3].T
    origin = np.broadcast_to(pose[:3, 3], directions.shape)
    return [torch.from_numpy(one.astype(np.float32).copy())[None] for one in (origin, directions)]


def soft(distance, edge=4 / VOXELS):
    """Return occupancy that falls from 1 to 0 over two voxels around a surface; 1/2 on it."""
    return torch.from_numpy(np.clip(0.5 - distance / edge, 0, 1).astype(np.float32))[None]


def test_a_ball_has_the_silhouette_depth_and_normals_of_a_ball():
    volume = soft(np.linalg.norm(centres(), axis=-1) - RADIUS)
    origin, direction = camera_rays()
    found = silhouettes(volume, BOX, origin, direction, 96)[0].numpy() > 0.5
    start, way = (one[0].double().numpy() for one in (origin, direction))
    length = np.linalg.norm(way, axis=1)
    middle = -(start * way).sum(axis=1) / length  # of the ray within the ball, as length
    miss2 = (start**2).sum(axis=1) - middle**2
    shown = miss2 < RADIUS**2
    assert 0.05 < shown.mean() < 0.5
    assert (found != shown).mean() < 0.01
    hit = first_hit(volume, BOX, origin, direction, 96)[0].double().numpy()
    assert (np.isfinite(hit) == found).all()
    sure = miss2 < (0.9 * RADIUS) ** 2
    true = (middle - np.sqrt(np.maximum(RADIUS**2 - miss2, 0))) / length
    assert np.abs(hit - true)[sure].max() < 0.5 * 2 / VOXELS
    points = (start + hit[:, None] * way)[sure]
    normals = outward(volume, BOX, torch.from_numpy(points).float()[None])[0].numpy()
    cosine = (normals * points).sum(axis=1) / np.linalg.norm(points, axis=1)
    assert np.degrees(np.arccos(np.clip(cosine, -1, 1))).mean() < 5


def test_a_sample_at_a_voxels_centre_is_the_voxel_and_axes_are_not_mixed_up():
    volume = torch.rand(1, 4, 4, 4, generator=torch.Generator().manual_seed(0))
    points = torch.from_numpy(centres(4)).float().reshape(1, -1, 3)
    assert sampled(volume, BOX, points)[0] == pytest.approx(volume.flatten().numpy(), abs=1e-6)
    assert sampled(volume, BOX, torch.tensor([[[0.0, 0.63, 0.0]]])).item() == 0


def test_rays_that_miss_or_point_away_see_nothing():
    volume = torch.ones(1, 4, 4, 4)
    origin = torch.tensor([[[3.0, 0, 0], [3.0, 0, 0], [3.0, 4.0, 0], [0.0, 0, 0]]])
    direction = torch.tensor([[[-1.0, 0, 0], [1.0, 0, 0], [-1.0, 0, 0], [0.0, 0, 1]]])
    assert silhouettes(volume, BOX, origin, direction, 8)[0].tolist() == [1, 0, 0, 1]
    hit = first_hit(volume, BOX, origin, direction, 8)[0]
    assert torch.isfinite(hit).tolist() == [True, False, False, True]
    assert hit[0].item() == pytest.approx(2, abs=0.2)


def test_gradients_of_volume_and_cameras_are_those_of_differences():
    draw = torch.Generator().manual_seed(1)
    volume = torch.rand(2, 4, 4, 4, generator=draw, dtype=torch.double, requires_grad=True)
    origin = torch.randn(2, 5, 3, generator=draw, dtype=torch.double) * 0.1
    origin[..., 2] += 3
    direction = torch.randn(2, 5, 3, generator=draw, dtype=torch.double) * 0.1
    direction[..., 2] = -1
    origin.requires_grad_()
    direction.requires_grad_()
    arguments = volume, BOX.double(), origin, direction, 6
    assert torch.autograd.gradcheck(silhouettes, arguments)
