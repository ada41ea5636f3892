"""The kernel against closed forms in double precision: spheres and planes.

Silhouettes are not left out: object ids agree on every pixel. Depth and normals agree to 1e-5;
where a ray grazes, single precision cannot, as errors grow by 1 / cosine of incidence: beyond a
cosine of 0.02 depth is held to 2e-7 / cosine, beyond 0.2 normals are held to 2e-6 / cosine.
"""

import math

import numpy as np
import pytest

from scenegen.camera import Camera, pixel_directions
from scenegen.description.scenes import PlacedObject, SceneSpec
from scenegen.description.specs import DatasetSpec
from scenegen.rendering.packing import pack
from scenegen.rendering.renderer import render

SPEC = DatasetSpec(
    height=48, width=64, objects=(0, 3), lights=(0, 0), shapes=("cone", "sphere"),
    min_visible_pixels=0, image_dtype="float32",
)  # fmt: skip
GREY = (0.8, 0.8, 0.8)


def point(values):
    x, y, z = (float(v) for v in values)
    return x, y, z


def random_scene(index):
    """Up to three spheres, which may intersect each other and the walls, from any viewpoint."""
    rng = np.random.default_rng(index)
    around = abs(rng.standard_normal(3))
    around *= rng.uniform(1.3, 2.5) / np.linalg.norm(around)
    camera = Camera(
        point(0.3 + around), point(rng.uniform(0.2, 0.5, 3)), float(rng.uniform(15, 60))
    )
    spheres = []
    for _ in range(index % 4):
        x, y, z, w = rng.standard_normal(4)
        norm = math.hypot(x, y, z, w)
        turn = (w / norm, x / norm, y / norm, z / norm)
        place, radius = point(rng.uniform(0.2, 0.8, 3)), float(rng.uniform(0.1, 0.3))
        spheres.append(PlacedObject("sphere", place, turn, radius, GREY))
    return SceneSpec(index, (camera,), tuple(spheres), (), (0.1,) * 3, (0.5, 0.5), GREY)


def closed_form(scene, height, width):
    """Depth, camera-frame normal, object id and cosine of incidence of all pixels."""
    camera = scene.cameras[0]
    matrix = camera.world_from_camera
    origin = np.array(camera.position)
    rays = pixel_directions(height, width, camera.fov_y_degrees) @ matrix[:3, :3].T
    with np.errstate(divide="ignore"):
        walls = np.where(rays < 0, -origin / rays, np.inf)
    depth, axis = walls.min(axis=-1), walls.argmin(axis=-1)
    with np.errstate(invalid="ignore"):
        met = (origin + depth[..., None] * rays).max(axis=-1) <= 1
    depth, object_id = np.where(met, depth, np.inf), np.where(met, 0, -1)
    normal = np.where(met[..., None], np.eye(3)[axis], 0.0)
    squared = (rays**2).sum(axis=-1)
    for k, item in enumerate(scene.objects):
        offset = origin - item.position
        b = rays @ offset
        root = b**2 - squared * (offset @ offset - item.scale**2)
        t = (-b - np.sqrt(np.maximum(root, 0))) / squared
        hit = (root > 0) & (t < depth)
        depth, object_id = np.where(hit, t, depth), np.where(hit, k + 1, object_id)
        out = (offset + t[..., None] * rays) / item.scale
        normal = np.where(hit[..., None], out, normal)
    cosine = -(normal * rays).sum(axis=-1) / np.sqrt(squared)
    return depth, normal @ matrix[:3, :3], object_id, cosine


@pytest.fixture(scope="module")
def scenes():
    return [random_scene(index) for index in range(60)]


@pytest.fixture(scope="module")
def truth(scenes):
    return render(pack(SPEC, scenes))


def test_spheres_and_planes_are_exact(scenes, truth):
    lengths = np.linalg.norm(truth.normal[truth.object_id >= 0], axis=-1)
    np.testing.assert_allclose(lengths, 1.0, atol=1e-6)
    pixels = {-1: 0, 0: 0, 1: 0}
    for b, scene in enumerate(scenes):
        depth, normal, object_id, cosine = closed_form(scene, SPEC.height, SPEC.width)
        np.testing.assert_array_equal(truth.object_id[b], object_id)
        hit = object_id >= 0
        assert np.isnan(truth.depth[b][~hit]).all()
        assert (truth.normal[b][~hit] == 0).all()
        depth_error = abs(truth.depth[b] - depth)[hit]
        assert (depth_error <= np.maximum(1e-5, 2e-7 / cosine[hit])).all()
        normal_error = abs(truth.normal[b] - normal).max(axis=-1)[hit]
        assert (normal_error <= np.maximum(1e-5, 2e-6 / cosine[hit])).all()
        for some in pixels:
            pixels[some] += np.count_nonzero(np.minimum(object_id, 1) == some)
    assert min(pixels.values()) > 10_000, "misses, room and spheres are all tried"
