"""Rasterised meshes: planes by hand, hard meshes in double precision, no seams, ties in order."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import trimesh
from model_rooms import FAMILIES
from numpy.typing import NDArray

from scenegen.camera import Camera, pixel_directions
from scenegen.description.scenes import PlacedObject, SceneSpec
from scenegen.objects.catalogue import Objects
from scenegen.objects.solids import Mesh, UnitShape
from scenegen.rendering.ground_truth import GroundTruth
from scenegen.rendering.packing import pack
from scenegen.rendering.renderer import render

Array = NDArray[Any]
SPEC = replace(FAMILIES, height=96, width=128, objects=(0, 3), shadows=False)
FEWER = replace(SPEC, height=48, width=64)
FAR = Camera((0.0, 0.0, 4.0), (0.0, 0.0, 0.0), 35.0)
UPRIGHT = (1.0, 0.0, 0.0, 0.0)


def scene_of(names: str, camera: Camera, scale: float = 1.0, turn: Any = UPRIGHT) -> SceneSpec:
    """Return a scene without a room, with objects "mug/a", "mug/b", ... at the origin."""
    quaternion = tuple((np.array(turn) / np.linalg.norm(turn)).tolist())
    objects = tuple(
        PlacedObject(f"mug/{name}", (0.0, 0.0, 0.0), quaternion, scale, (0.5, 0.5, 0.5))
        for name in names
    )
    return SceneSpec(0, (camera,), objects, (), (1.0, 1.0, 1.0), (1.0, 0.0), None)


def objects_of(**meshes: Array) -> Objects:
    """Return objects of triangles, (F, 3, 3), by name."""

    def shape(name: str) -> UnitShape:
        corners = meshes[name.partition("/")[2]].astype(np.float32).reshape(-1, 3)
        mesh = Mesh(corners, np.arange(len(corners)).reshape(-1, 3), None)
        return UnitShape(name, lambda: mesh, *np.zeros((2, 1, 3)), 0.0, np.zeros((0, 3)))

    return Objects({"mug": [f"mug/{name}" for name in meshes]}, shape, lambda name: "")


def seen(scene: SceneSpec, objects: Objects, **settings: Any) -> GroundTruth:
    return render(pack(replace(SPEC, **settings), [scene], objects=objects))


def soup(rng: np.random.Generator, count: int) -> Array:
    """Random triangles, open and through each other; a third are needles, a tenth stand twice."""
    corners = rng.uniform(-0.5, 0.5, (count, 1, 3)) + rng.normal(0, 0.1, (count, 3, 3))
    corners[::3, 2] = corners[::3, 1] + 1e-4 * (corners[::3, 2] - corners[::3, 1])
    return np.concatenate([corners, corners[::10]])


def cast_in_double(scene: SceneSpec, objects: Objects) -> tuple[Array, Array, Array]:
    """Return depth, object id and face normal of every pixel, from every triangle, in float64."""
    batch = pack(FEWER, [scene], objects=objects)
    rays = pixel_directions(FEWER.height, FEWER.width, float(batch.fov_y_degrees[0])).reshape(-1, 3)
    depth, ids, normal = np.full(len(rays), np.inf), np.full(len(rays), -1), np.zeros_like(rays)
    for slot, model in enumerate(batch.shape[0].tolist()):
        matrix = np.linalg.inv(batch.world_from_camera[0]) @ batch.world_from_object[0, slot]
        triangles = objects.shape(batch.names[model]).triangles
        for part in np.array_split(triangles @ matrix[:3, :3].T + matrix[:3, 3], 100):
            a, b, c = part.swapaxes(0, 1)
            sides = np.stack([rays @ np.cross(p, q).T for p, q in ((b, c), (c, a), (a, b))])
            inside = (sides >= 0).all(axis=0) | (sides <= 0).all(axis=0)
            across = np.cross(b - a, c - a)
            with np.errstate(all="ignore"):
                t = (a * across).sum(axis=1) / (rays @ across.T)
                t = np.where(inside & (t > 0), t, np.inf)
            nearest = t.min(axis=1)
            nearer = nearest < depth
            depth[nearer], ids[nearer] = nearest[nearer], slot + 1
            normal[nearer] = across[t.argmin(axis=1)][nearer]
    size = FEWER.height, FEWER.width
    return depth.reshape(size), ids.reshape(size), normal.reshape(*size, 3)


@pytest.mark.parametrize(
    "seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (1, 2, 3))]
)
def test_hard_meshes_agree_with_all_triangles_cast_in_double_precision(seed: int) -> None:
    rng = np.random.default_rng(seed)
    objects = objects_of(a=soup(rng, 300), b=soup(rng, 6000) * 0.7)
    camera = Camera(tuple((rng.normal(size=3) * 1.5 + (0, 0, 2)).tolist()), (0.0, 0.1, 0.0), 40.0)
    scene = scene_of("ab", camera, 0.9, rng.normal(size=4))
    truth = seen(scene, objects, height=FEWER.height, width=FEWER.width)
    depth, ids, normal = cast_in_double(scene, objects)
    hit = (ids >= 0) & (truth.object_id[0] == ids)
    assert hit.mean() > 0.05
    assert (truth.object_id[0] != ids).sum() <= 1
    assert (abs(truth.depth[0] - depth)[hit] > 1e-4).sum() <= 1
    normal = normal[hit] / np.linalg.norm(normal[hit], axis=1, keepdims=True)
    assert (abs((truth.normal[0][hit] * normal).sum(axis=-1)) < 1 - 1e-4).sum() <= 1


@pytest.mark.parametrize("scale", [1.0, 0.02, 30.0])
@pytest.mark.parametrize("seed", range(3))
def test_no_ray_slips_between_neighbours(scale: float, seed: int) -> None:
    """A ball of 20,480 faces covers the ball inside it wherever it is turned, however large."""
    turn = np.random.default_rng(seed).normal(size=4)
    ball = trimesh.creation.icosphere(5).triangles
    camera = Camera((0.0, 0.0, 4.0 * scale), (0.0, 0.0, 0.0), 31.0)
    truth = seen(scene_of("a", camera, scale, turn), objects_of(a=ball), height=256, width=256)
    rays = pixel_directions(256, 256, 31.0)
    squared = (rays**2).sum(axis=-1)
    inside = 16 * (1 / squared - 1) + 0.998**2 > 0
    assert (truth.object_id[0][inside] == 1).all()
    near = (4 - np.sqrt(np.maximum(16 - squared * 15, 0))) / squared * scale
    assert abs(truth.depth[0] - near)[inside].max() < 0.02 * scale


def test_edges_through_the_centres_of_pixels_are_covered() -> None:
    """The rays of each row of pixels meet an edge that two triangles share, and nothing else."""
    rays = pixel_directions(96, 128, 35.0)[:, [0, -1]]
    depths = np.random.default_rng(1).uniform(3, 5, (96, 2))
    left, right = (rays * depths[..., None] + (0, 0, 4)).swapaxes(0, 1)
    upper = np.stack([left[:-1], left[1:], right[1:]], axis=1)
    lower = np.stack([left[:-1], right[1:], right[:-1]], axis=1)
    truth = seen(scene_of("a", FAR), objects_of(a=np.concatenate([upper, lower])))
    assert (truth.object_id[0, 1:-1, 1:-1] == 1).all()
    share = np.linspace(0, 1, 128)[1:-1]
    expected = 1 / (1 / depths[1:-1, :1] * (1 - share) + 1 / depths[1:-1, 1:] * share)
    np.testing.assert_allclose(truth.depth[0, 1:-1, 1:-1], expected, atol=1e-4)


def test_planes_through_and_behind_the_camera() -> None:
    """A floor that goes on behind the camera, and a wall behind it, which is not seen."""
    floor = np.array([[(-9, -0.5, 9), (9, -0.5, 9), (0, -0.5, -9)]], float)
    wall = np.array([[(-9, -9, 5), (9, -9, 5), (0, 9, 5)]], float)
    truth = seen(scene_of("ab", FAR), objects_of(a=floor, b=wall))
    down = -pixel_directions(96, 128, 35.0)[..., 1]
    with np.errstate(divide="ignore"):
        expected = np.where(down > 0, 0.5 / down, np.inf)
    ids = truth.object_id[0]
    assert set(np.unique(ids)) == {-1, 1}
    clear = (expected < 11) & (abs(expected - 4) > 1e-3)
    assert (ids == 1)[clear & (expected > 4)].mean() > 0.5
    np.testing.assert_allclose(truth.depth[0][ids == 1], expected[ids == 1], rtol=1e-5)
    assert abs(truth.normal[0][ids == 1] - (0, 1, 0)).max() < 1e-6


def test_of_equal_depths_the_first_object_wins_and_the_room_loses() -> None:
    square = np.array([[(-0.5, -0.5, 0), (0.5, -0.5, 0), (0.5, 0.5, 0)]], float)
    scene = scene_of("ab", FAR)
    truth = seen(scene, objects_of(a=square, b=square[:, ::-1]))
    assert set(np.unique(truth.object_id)) == {-1, 1}
    roomed = replace(scene, room_reflectance=(0.5, 0.5, 0.5))
    half = np.array([[(0, 0, 0), (0.5, 0, 0), (0.5, 0.5, 0)]], float)
    assert (seen(roomed, objects_of(a=half, b=half)).object_id == 1).sum() > 100


def test_samples_of_a_pixel_average_to_the_covered_share() -> None:
    """The border of a white square before nothing; its area in pixels is known."""
    square = np.array([(-0.3, -0.3, 0), (0.3, -0.3, 0), (0.3, 0.3, 0), (-0.3, 0.3, 0)])
    mesh = square[np.array([(0, 1, 2), (0, 2, 3)])]
    scene = scene_of("a", FAR, turn=(0.9, 0.0, 0.0, 0.3))
    image = seen(scene, objects_of(a=mesh), spp=64).image[0]
    side = 0.6 / 4 / (2 * np.tan(np.radians(35.0) / 2) / 96)
    assert image[..., 0].sum() / 0.5 == pytest.approx(side**2, rel=0.01)


def smooth_triangle(normals: Array) -> tuple[Array, Array, Array]:
    """Return shares of corners, normals and rays, (P, 3), where a triangle of these is seen."""
    corners = np.array([(-0.5, -0.5, 0.0), (0.5, -0.5, 0.0), (-0.5, 0.5, 0.0)])
    mesh = Mesh(corners.astype(np.float32), np.arange(3)[None], normals.astype(np.float32))
    shape = UnitShape("mug/a", lambda: mesh, *np.zeros((2, 1, 3)), 0.0, np.zeros((0, 3)))
    truth = seen(scene_of("a", FAR), Objects({"mug": ["mug/a"]}, lambda _: shape, lambda _: ""))
    rays, shown = pixel_directions(96, 128, 35.0), truth.object_id[0] == 1
    place = 4.0 * rays[..., :2] + 0.5
    shares = np.concatenate([1.0 - place.sum(axis=-1, keepdims=True), place], axis=-1)
    assert shown.sum() > 300
    return shares[shown], truth.normal[0][shown], rays[shown]


def test_smooth_normals_are_those_of_the_corners_by_their_shares() -> None:
    corners = np.array([(0.0, 0.0, 1.0), (0.6, 0.0, 0.8), (0.0, -0.8, 0.6)])
    shares, normals, _ = smooth_triangle(corners)
    expected = shares @ corners
    expected /= np.linalg.norm(expected, axis=-1, keepdims=True)
    np.testing.assert_allclose(normals, expected, atol=1e-4)


def test_smooth_normals_that_lean_away_are_perpendicular_to_their_rays() -> None:
    """And in one plane with them and what they were."""
    away = np.array([0.96, 0.0, -0.28])
    _, normals, rays = smooth_triangle(np.tile(away, (3, 1)))
    assert abs((normals * rays).sum(axis=-1)).max() < 1e-6
    assert abs((normals * np.cross(rays, away)).sum(axis=-1)).max() < 1e-6
    assert (normals @ away > 0.9).all()
