"""The kernel's exact surfaces against numpy's, which are solved by other formulas in float64."""

import importlib

import numpy as np
import pytest

from scenegen.description.shapes import BASIC_SHAPES
from scenegen.objects.basic_shapes import unit_shape
from scenegen.rendering.surfaces.in_numpy import cast_at_surface

EXACT = tuple(shape.name for shape in BASIC_SHAPES if shape.volume)
RAYS = 100_000


def cast(names, which, start, u):
    """Return distances and unit normals by the kernel, which is made for all the shapes."""
    import mitsuba as mi

    hits = importlib.import_module("scenegen.rendering.surfaces.in_kernel")
    surfaces = hits.upload_surfaces([unit_shape(name).surface for name in names])
    record = [mi.Float(float(value)) for value in surfaces.record[which]]
    o, d = (mi.Vector3f(*(mi.Float(x) for x in v.astype(np.float32).T)) for v in (start, u))
    x, face = hits.first_on_surface(surfaces, record, o, d, mi.Float(2.001))
    points = o + mi.Float(np.nan_to_num(np.asarray(x), posinf=0.0)) * d
    n = hits.normal_on_surface(surfaces, record, points, face)
    normals = np.asarray(n).T
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.asarray(x), normals / np.where(length > 0, length, 1.0)  # misses may have none


def unit_rays(radius, seed):
    """Return points at this distance, and unit directions to points of the ball; float32 exact."""
    rng = np.random.default_rng(seed)
    start, target = rng.standard_normal((2, RAYS, 3))
    start *= radius / np.linalg.norm(start, axis=1, keepdims=True)
    target *= rng.random((RAYS, 1)) ** (1 / 3) / np.linalg.norm(target, axis=1, keepdims=True)
    u = target - start
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    return start.astype(np.float32).astype(float), u.astype(np.float32).astype(float)


@pytest.mark.parametrize("radius", [1.0001, 0.3, pytest.param(0.05, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", EXACT)
def test_hits_are_exact_to_a_millionth(name, radius, variant):
    surface = unit_shape(name).surface
    assert surface is not None
    start, u = unit_rays(radius, seed=1)
    ours, normals = cast(EXACT, EXACT.index(name), start, u)
    expected, expected_normals = cast_at_surface(surface, start, u)
    hit = np.isfinite(ours)
    assert hit.mean() > 0.3
    assert (hit != np.isfinite(expected)).sum() <= 1e-4 * RAYS
    both = hit & np.isfinite(expected)
    cosine = abs(np.einsum("ri,ri->r", expected_normals, u))[both]
    error = abs(ours[both] - expected[both])
    assert np.mean(error * cosine > 1e-6) < 1e-4, "but for rays that touch a rim or an edge"
    assert np.mean(error > 1e-4) < 1e-4
    aligned = abs(np.einsum("ri,ri->r", normals, expected_normals))[both]
    assert np.mean(aligned < 1 - 1e-6) < 1e-3


@pytest.mark.parametrize("name", EXACT)
def test_rays_along_the_axes_are_like_their_neighbours(name, variant):
    """Parallel to caps, slabs and the axis of revolution, where a division by 0 lurks."""
    surface = unit_shape(name).surface
    assert surface is not None
    rng = np.random.default_rng(2)
    start = np.repeat(np.concatenate([np.eye(3), -np.eye(3)]), 500, axis=0)
    u = -start
    aside = rng.uniform(-0.4, 0.4, start.shape) * (start == 0)
    aside[::50] = 0.0  # through the centre
    start = 1.0001 * start + aside  # where bounding spheres are entered
    start = start.astype(np.float32).astype(float)
    ours, _ = cast(EXACT, EXACT.index(name), start, u)
    expected, _ = cast_at_surface(surface, start, u)
    same = np.isfinite(ours) == np.isfinite(expected)
    assert (~same).sum() <= 12, "but for the hole, edges and the tip"
    both = same & np.isfinite(ours)
    assert both.sum() > 500
    assert abs(ours[both] - expected[both]).max() < 2e-6
