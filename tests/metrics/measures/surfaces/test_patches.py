"""Distances between surfaces over resolutions; `test_definitions` has the formula."""

import numpy as np
import pytest

from metrics.measures.surfaces.chamfer_hausdorff import nearest_distances
from metrics.measures.surfaces.patches import surface_distances, surface_of
from scenegen.camera import back_project, pixel_directions, pixel_size

RNG = np.random.default_rng(3)
FOV = 50.0


def ball(height, width, shift=(0.0, 0.0)):
    """Points and normals (H, W, 3) of a ball before a wall, seen `shift` pixels off the centres."""
    rays = pixel_directions(height, width, FOV)
    rays[..., :2] += np.array([1.0, -1.0]) * shift * pixel_size(height, FOV)
    centre, radius = np.array([0.2, -0.1, -2.0]), 0.5
    a, b = (rays**2).sum(axis=-1), rays @ centre
    root = b**2 - a * (centre @ centre - radius**2)
    hit = root > 0.0
    depth = np.where(hit, (b - np.sqrt(np.maximum(root, 0.0))) / a, 3.0)
    points = rays * depth[..., None]
    return points, np.where(hit[..., None], (points - centre) / radius, [0.0, 0.0, 1.0])


def found(points, normals, true, true_normals, mask, pitch, on_rays=False):
    said, truth = (
        surface_of(p[mask], n[mask], pitch, mask)
        for p, n in ((points, normals), (true, true_normals))
    )
    nearest = nearest_distances(points[mask], true[mask])
    distances = surface_distances(said, truth, nearest, on_rays)
    return distances.forward, distances.reverse


def test_the_same_surface_scores_nothing_wherever_it_is_sampled():
    """Points alone are half a pixel apart; at 64 pixels that is 50 times as much."""
    for size in (64, 128):
        true, normals = ball(size, size)
        moved, their_normals = ball(size, size, RNG.uniform(-0.5, 0.5, (size, size, 2)))
        mask, pitch = np.ones((size, size), bool), pixel_size(size, FOV)
        means = [d.mean() for d in found(moved, their_normals, true, normals, mask, pitch)]
        apart = nearest_distances(moved[mask], true[mask])
        assert sum(means) < 0.02 * (apart.forward.mean() + apart.reverse.mean())


def test_a_wrong_surface_scores_alike_at_all_resolutions():
    """The wall alone, where the truth has a ball before it."""
    scores = []
    for size in (64, 256):
        true, normals = ball(size, size)
        wall = back_project(np.full((size, size), 3.0), FOV)
        facing = np.broadcast_to([0.0, 0.0, 1.0], wall.shape)
        mask = np.ones((size, size), bool)
        both = found(wall, facing, true, normals, mask, pixel_size(size, FOV), True)
        scores.append([*(d.mean() for d in both), *(d.max() for d in both)])
    assert scores[0] == pytest.approx(scores[1], rel=0.03)
