"""Distances between surfaces, against loops over all pairs, and over resolutions."""

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


def by_loops(points, normals, true, true_normals, mask, pitch):
    """The least distances both ways, pair by pair, as the module's docstring defines them."""
    height, width = mask.shape
    places = np.argwhere(mask).tolist()

    def to_patch(q, p, n):
        h = n @ (q - p)
        along = np.sqrt(max((q - p) @ (q - p) - h * h, 0.0))
        reach = 1.5 * pitch * max(-p[2], 0.0) / max(-(n @ p) / np.linalg.norm(p), 0.3)
        return np.hypot(h, max(along - reach, 0.0))

    forward, reverse = (np.full(mask.shape, np.inf) for _ in range(2))
    for j in map(tuple, places):
        p = points[j]
        seen = (-1000, -1000)
        if p[2] < 0.0:
            u, v = p[0] / -p[2] / pitch + width / 2, height / 2 - p[1] / -p[2] / pitch
            seen = int(np.floor(v)), int(np.floor(u))
        for i in map(tuple, places):
            d = e = np.linalg.norm(p - true[i])
            if max(abs(seen[0] - i[0]), abs(seen[1] - i[1])) <= 1:
                d = min(d, to_patch(p, true[i], true_normals[i]))
                e = min(e, to_patch(true[i], p, normals[j]))
            forward[j], reverse[i] = min(forward[j], d), min(reverse[i], e)
    return forward[mask], reverse[mask]


def found(points, normals, true, true_normals, mask, pitch, on_rays=False):
    said, truth = (
        surface_of(p[mask], n[mask], pitch, mask)
        for p, n in ((points, normals), (true, true_normals))
    )
    nearest = nearest_distances(points[mask], true[mask])
    distances = surface_distances(said, truth, nearest, on_rays)
    return distances.forward, distances.reverse


CASES = {
    "noise": lambda t: t * RNG.uniform(0.98, 1.02, (*t.shape[:2], 1)),
    "wide": lambda t: t * [1.31, 0.9, 1.0],
    "mirrored": lambda t: t * [-1.0, 1.0, 1.0],
    "behind": lambda t: t * np.where(np.arange(t.shape[1]) < 3, -1.0, 1.0)[:, None],
    "aside": lambda t: t + np.array([5.0, 0.0, 0.0]),
}


@pytest.mark.parametrize("name", CASES)
def test_distances_are_those_of_loops(name):
    true, normals = ball(9, 11)
    mask = RNG.random((9, 11)) < 0.9
    points = CASES[name](true)
    said = RNG.normal(size=normals.shape)
    said /= np.linalg.norm(said, axis=-1, keepdims=True)
    arguments = (points, said, true, normals, mask, pixel_size(9, FOV))
    expected = by_loops(*arguments)
    for on_rays in (False, True)[: 2 if name in ("noise", "behind") else 1]:
        for one, other in zip(found(*arguments, on_rays), expected, strict=True):
            np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-12)


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
