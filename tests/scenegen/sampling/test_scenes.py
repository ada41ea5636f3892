"""Scenes: pure, drawn from the distributions they claim, and sound on the geometry itself."""

import itertools
import math

import numpy as np
import pytest
from scipy.stats import chisquare, kstest

from scenegen.camera import Camera
from scenegen.description.names import SHAPE_NAMES
from scenegen.description.specs import DatasetSpec
from scenegen.rendering.packing import pack, pack_arrays
from scenegen.sampling.scenes import sample_scene, sample_scenes


def scenes_at_once(spec, count):
    """The first so many scenes, of which none is refused; each is as if it were drawn alone."""
    placed, scenes = sample_scenes(spec, range(count), [0] * count)
    assert placed.all()
    return [scenes.scene(row) for row in range(count)]


@pytest.mark.parametrize(
    "settings",
    [
        {"random_reflectance": True, "views": (0.0, 30.0, 80.0), "lights": (0, 5)},
        {"objects": (0, 6), "pose": "any", "height": 60, "width": 90, "seed": 2**63 - 1},
        {"source": "families", "shapes": ("cap", "mug"), "specular": (0.1, 0.9)},
    ],
)
def test_a_scene_is_the_same_alone_and_in_any_company(settings):
    """To the bit: as a record, as arrays, and as JSON."""
    spec = DatasetSpec(**settings)
    pairs = [(i, a) for i in (0, 3, 2**40, 2**62) for a in (0, 1, 7)]
    placed, many = sample_scenes(spec, *zip(*pairs, strict=True))
    alone = [sample_scene(spec, *pair) for pair in pairs]
    assert [scene is not None for scene in alone] == placed.tolist()
    assert placed.sum() > 8
    found = [scene for scene in alone if scene is not None]
    assert [many.scene(row) for row in range(len(many))] == found
    assert [many.to_json(row) for row in range(len(many))] == [one.to_json() for one in found]
    backwards = sample_scenes(spec, *zip(*pairs[::-1], strict=True))[1].take(slice(None, None, -1))
    ours, theirs = (
        pack(spec, found, range(len(spec.views))),
        pack_arrays(spec, backwards, range(len(spec.views))),
    )
    assert ours.names == theirs.names
    for name, values in vars(ours).items():
        if isinstance(values, np.ndarray):
            assert values.tobytes() == getattr(theirs, name).tobytes(), name
            assert values.dtype == getattr(theirs, name).dtype, name


def test_shapes_and_their_number_are_uniform():
    """On requests with tiny objects, so that none is refused for want of room."""
    spec = DatasetSpec(object_radius=(0.02, 0.03), shapes=SHAPE_NAMES)
    scenes = scenes_at_once(spec, 600)
    assert chisquare(np.bincount([len(scene.objects) for scene in scenes])[1:]).pvalue > 0.01
    names = [item.shape for scene in scenes for item in scene.objects]
    assert chisquare([names.count(name) for name in SHAPE_NAMES]).pvalue > 0.01
    scales = np.array([item.scale for scene in scenes for item in scene.objects])
    assert kstest(scales, "uniform", (0.02, 0.01)).pvalue > 0.01


@pytest.mark.parametrize(
    "settings",
    [{}, {"pose": "any", "height": 60, "width": 90}, {"allow_cropped": True}, {"objects": (4, 5)}],
)
def test_objects_are_in_the_room_on_the_floor_in_the_image_and_disjoint(
    settings, scenes_of, world_corners, gap_between
):
    spec = DatasetSpec(**settings)
    hover = 3e-3 if spec.pose == "any" else 1e-3  # of the radius; the teapot's body is a bit round
    for scene in scenes_of(spec, 6):
        camera = scene.cameras[0]
        camera_from_world = np.linalg.inv(camera.world_from_camera)
        half = (
            math.tan(math.radians(spec.fov_degrees) / 2)
            * math.sqrt(2)
            / math.hypot(spec.height, spec.width)
        )
        placed = [world_corners(item) for item in scene.objects]
        for item, corners in zip(scene.objects, placed, strict=True):
            assert corners.min() > -1e-12
            assert corners.max() < 1 + 1e-12
            assert corners[:, 1].min() < hover * item.scale
            shown = np.array([item.position]) if spec.allow_cropped else corners
            seen = shown @ camera_from_world[:3, :3].T + camera_from_world[:3, 3]
            border = -seen[:, 2:] * half * [spec.width, spec.height]
            assert (seen[:, 2] < 0).all()
            assert (abs(seen[:, :2]) <= border + 1e-9).all()
        for one, other in itertools.combinations(placed, 2):
            assert gap_between(one, other) > 0.0


@pytest.mark.parametrize("size", [(128, 128), (96, 160), (160, 96)])
def test_the_room_fills_the_image_from_everywhere_on_the_octant(size):
    """Rays through the image's borders and inside, from corners, edges and inside the octant."""
    spec = DatasetSpec(height=size[0], width=size[1])
    half = math.tan(math.radians(spec.fov_degrees) / 2) * math.sqrt(2) / math.hypot(*size)
    x, y = np.meshgrid(*(np.linspace(-half * side, half * side, 13) for side in size[::-1]))
    directions = np.stack([x, y, -np.ones_like(x)], axis=-1).reshape(-1, 3)
    for height in [*np.linspace(0, 1, 15)[:-1], 1 - 1e-9]:
        for azimuth in np.linspace(0, math.pi / 2, 15):
            around = math.sqrt(1 - height**2)
            offset = (around * math.cos(azimuth), height, around * math.sin(azimuth))
            position = np.array(spec.camera_target) + spec.camera_radius * np.array(offset)
            camera = Camera(tuple(position.tolist()), spec.camera_target, spec.fov_y_degrees)
            rays = directions @ camera.world_from_camera[:3, :3].T
            with np.errstate(divide="ignore"):
                t = np.where(rays < 0, -position / rays, np.inf).min(axis=1)
            assert (position + t[:, None] * rays).max() <= 1.0, (height, azimuth)
