"""Pictures of meshes against analytic spheres and boxes, another ray caster, and the shading."""

import numpy as np
import pytest
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from baselines.rezende.network import icosphere
from baselines.rezende.rasteriser import Views, rasterise
from scenegen.camera import pixel_directions

SIZE, FOV, DISTANCE = 48, 28.0, 4.5
RNG = np.random.default_rng(4)


def views(count, size=SIZE):
    return Views(
        size=size,
        fov_y_degrees=FOV,
        distance=DISTANCE,
        reflectance=np.array([0.8, 0.7, 0.6]),
        ambient=np.array([0.1, 0.2, 0.3]),
        background=np.array([1.0, 0.9, 0.8]),
        attenuation=(0.3, 0.7),
        light_position=RNG.normal((2, 3, 6), size=(count, 2, 3)),
        light_color=RNG.uniform(1, 9, (count, 2, 3)),
    )


def rays(size=SIZE):
    return pixel_directions(size, size, FOV), np.array([0.0, 0.0, DISTANCE])


def box(seed):
    """Return a turned box: vertices, triangles anticlockwise from outside, its axes as rows."""
    turn = Rotation.random(random_state=seed).as_matrix()
    half = np.array([0.7, 0.4, 0.5])
    corners = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T * half
    faces = ConvexHull(corners).simplices
    inward = np.linalg.det(corners[faces]) < 0
    faces[inward] = faces[inward][:, ::-1]
    return corners @ turn.T, faces, turn.T, half


@pytest.mark.parametrize("seed", range(4))
def test_a_box_has_the_silhouette_and_depth_of_its_slabs(seed):
    vertices, faces, axes, half = box(seed)
    _, depth = rasterise(vertices[None], faces, views(1))
    directions, origin = rays()
    crossings = (
        (sign * half[:, None, None] - (axes @ origin)[:, None, None])
        / (np.moveaxis(directions @ axes.T, 2, 0))
        for sign in (-1, 1)
    )
    both = np.sort(np.stack(list(crossings)), axis=0)
    enter, leave = both[0].max(axis=0), both[1].min(axis=0)
    shown = np.isfinite(depth[0])
    sure = abs(leave - enter) > 1e-3
    np.testing.assert_array_equal(shown[sure], (enter < leave)[sure])
    assert 100 < shown.sum() < sure.sum()
    np.testing.assert_allclose(depth[0][shown & sure], enter[shown & sure], rtol=1e-4)


def crumpled(count, noise=0.25):
    vertices, faces = icosphere(2)
    return (vertices + noise * RNG.normal(size=(count, *vertices.shape))).astype(np.float32), faces


def test_crumpled_meshes_are_those_of_another_ray_caster():
    trimesh = pytest.importorskip("trimesh")
    pytest.importorskip("embreex")
    meshes, faces = crumpled(3)
    _, depth = rasterise(meshes, faces, views(3))
    directions, origin = rays()
    flat = directions.reshape(-1, 3)
    for vertices, found in zip(meshes, depth):
        mesh = trimesh.Trimesh(vertices, faces, process=False)
        points, ray, triangle = mesh.ray.intersects_location(
            np.tile(origin, (len(flat), 1)), flat, multiple_hits=True
        )
        facing = (mesh.face_normals[triangle] * flat[ray]).sum(axis=1) < 0
        true = np.full(len(flat), np.inf)
        np.minimum.at(true, ray[facing], DISTANCE - points[facing, 2])
        agree = np.isclose(found.ravel(), true, atol=1e-3)
        assert agree.mean() > 0.99  # rays through an edge may hit either side
        assert np.isfinite(true).mean() > 0.3


def test_what_is_behind_the_camera_or_too_near_does_not_show():
    vertices, faces = icosphere(3)
    _, behind = rasterise(vertices[None] + [0, 0, 2 * DISTANCE], faces, views(1))
    assert np.isinf(behind).all()
    _, near = rasterise(0.05 * vertices[None] + [0, 0, DISTANCE - 0.15], faces, views(1))
    assert np.isinf(near).all()
    inside = vertices[None] + np.array([0, 0, DISTANCE - 0.9])  # the camera is within the sphere
    assert np.isinf(rasterise(inside, faces, views(1))[1]).all()
    _, depth = rasterise(inside, faces[:, ::-1], views(1))
    directions, _ = rays()
    a, b = (directions**2).sum(axis=2), 0.9
    true = (b + np.sqrt(b**2 - a * (b**2 - 1))) / a
    np.testing.assert_allclose(depth[0], true, atol=0.03)
