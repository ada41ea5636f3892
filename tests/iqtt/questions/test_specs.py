"""Requests for splits: each rule, what its refusal says, JSON both ways, and the one camera."""

import json
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from iqtt.questions.specs import PRESETS, SplitSpec, preset_spec
from iqtt.shapes.polycube import bounding_radius, box_centre
from iqtt.shapes.sampling import random_shapes
from scenegen.camera import intrinsics
from scenegen.common.errors import SpecError

NAN, INF = math.nan, math.inf
REFUSED = [
    ({"seed": -1}, "seed: found -1, expected 0 to 2**63 - 1"),
    ({"seed": 2**63}, "seed: found 9223372036854775808, expected 0 to 2**63 - 1"),
    *(
        ({name: count}, f"{name}: found {count}, expected from 0 to 100,000,000 questions")
        for name in ("train", "val", "test")
        for count in (-1, 10**8 + 1)
    ),
    ({"labeled": -1}, "labeled: found -1, expected from 0 to the 1000 training questions"),
    ({"train": 9, "labeled": 10}, "labeled: found 10, expected from 0 to the 9 training questions"),
    *(
        ({"cubes": cubes}, f"cubes: found {text}, expected a number or a rising range within 3-16")
        for cubes, text in (((2, 5), "2-5"), ((5, 17), "5-17"), ((7, 6), "7-6"), ((-3, 3), "-3-3"))
    ),
    ({"shapes": "ring"}, "shapes: found ring, expected one of chain, tree"),
    ({"distractors": ""}, "distractors: found nothing, expected one of other, near, mirror, mixed"),
    ({"height": 15}, "size: found 15x128, expected from 16 to 4096 pixels a side"),
    ({"width": 15}, "size: found 128x15, expected from 16 to 4096 pixels a side"),
    ({"height": 4097}, "size: found 4097x128, expected from 16 to 4096 pixels a side"),
    ({"width": 4097}, "size: found 128x4097, expected from 16 to 4096 pixels a side"),
    ({"image_dtype": "int8"}, "image dtype: found int8, expected one of uint8, float16, float32"),
    *(
        ({"min_angle_degrees": x}, f"min angle: found {x}, expected from 0 to 90 degrees")
        for x in (-0.5, 90.5, NAN)
    ),
    *(
        ({"min_cube_pixels": x}, f"pixels: found {x}, expected from 0 to 60, a fifth of a cube's")
        for x in (-1, 61)
    ),
    (
        {"height": 64, "min_cube_pixels": 16},
        "min cube pixels: found 16, expected from 0 to 15, a fifth of a cube's face at 64x128",
    ),
    *(
        ({"max_radius": x}, f"max radius: found {x}, expected from 1.5 to 10 edges")
        for x in (0.0, -3.5, 1.49, 10.5, NAN, INF)
    ),
    *(
        ({"lights": x}, f"lights: found {x[0]}-{x[1]}, expected a number or a rising range within")
        for x in ((0, 2), (3, 2), (1, 17))
    ),
    *(
        ({"fov_degrees": x}, f"fov: found {x}, expected from 5 to 90 degrees")
        for x in (0.0, 4.9, 90.5, 360.0, NAN)
    ),
    *(
        ({"light_level": x}, f"light level: found {x}, expected from 0 to 100")
        for x in (-0.1, 100.5, NAN)
    ),
    *(
        ({name: color}, f"{name}: found {color}, expected channels from 0 to 1")
        for name in ("background", "ambient", "reflectance")
        for color in ((0.0, 0.0, 1.1), (-0.1, 0.0, 0.0), (0.0, NAN, 0.0))
    ),
]
EDGES = [
    {"seed": 0},
    {"seed": 2**63 - 1},
    {"train": 0, "labeled": 0, "val": 0, "test": 0},
    {"train": 10**8, "labeled": 10**8, "val": 10**8, "test": 10**8},
    {"cubes": (3, 3)},
    {"cubes": (16, 16)},
    {"cubes": (3, 16), "shapes": "tree"},
    {"height": 16, "width": 16, "min_cube_pixels": 1},
    {"height": 4096, "width": 16, "min_cube_pixels": 0},
    {"height": 16, "width": 4096, "min_cube_pixels": 0},
    {"min_angle_degrees": 0},
    {"min_angle_degrees": 90},
    {"min_cube_pixels": 60},
    {"max_radius": 1.5},
    {"max_radius": 10, "min_cube_pixels": 0},
    {"lights": (1, 16)},
    {"fov_degrees": 5},
    {"fov_degrees": 90},
    {"light_level": 0, "ambient": (0, 0, 0), "reflectance": (1, 1, 1), "background": (0, 1, 0)},
]


@pytest.mark.parametrize(("changed", "text"), REFUSED)
def test_a_setting_out_of_range_is_refused_with_what_is_expected(changed, text):
    with pytest.raises(SpecError) as error:
        SplitSpec(**changed)
    assert text in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("changed", EDGES)
def test_the_ends_of_each_range_are_accepted_and_survive_json(changed):
    spec = SplitSpec(**changed)
    assert SplitSpec.from_json(spec.to_json()) == spec
    assert spec.render_spec().object_slots == spec.cubes[1]
    assert spec.render_spec().light_slots == spec.lights[1]
    assert (spec.render_spec().height, spec.render_spec().width) == (spec.height, spec.width)
    assert spec.render_spec(2).image_dtype == spec.image_dtype


def test_json_is_one_sorted_line_of_pythons_own_types():
    spec = SplitSpec(
        seed=np.int64(4), cubes=[5, 6], ambient=[0, 0.5, 1], max_radius=3, val=np.int8(3)
    )
    raw = json.loads(spec.to_json())
    assert "\n" not in spec.to_json()
    assert list(raw) == sorted(vars(spec))
    assert (spec.cubes, spec.ambient, spec.max_radius) == ((5, 6), (0.0, 0.5, 1.0), 3.0)
    assert (raw["seed"], raw["val"], raw["cubes"]) == (4, 3, [5, 6])
    assert hash(SplitSpec.from_json(spec.to_json())) == hash(spec)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("{", "split spec: found EOF"),
        ("[]", "split spec: found [], expected a JSON object"),
        ('{"size":3}', "split spec: found an unknown field 'size'"),
        ('{"train":1.5}', "train: found 1.5, expected a whole number"),
        ('{"seed":"1"}', "seed: found '1', expected a whole number"),
        ('{"light_level":NaN}', "light level: found nan, expected a finite number"),
        ('{"train":-1}', "train: found -1, expected from 0"),
        ('{"cubes":[5]}', "cubes: found 1 values, expected more"),
    ],
)
def test_what_is_no_request_is_refused(text, told):
    with pytest.raises(SpecError) as error:
        SplitSpec.from_json(text)
    assert told in str(error.value)


def test_the_public_request_is_the_same_but_for_its_seed():
    specs = [SplitSpec(seed=seed, val=7) for seed in (0, 3, 2**62)]
    public = {spec.public() for spec in specs}
    assert len(public) == 1
    assert public == {SplitSpec(seed=None, val=7)}
    assert '"seed":null' in specs[1].public().to_json()
    assert SplitSpec.from_json(specs[1].public().to_json()) == specs[1].public()


def test_presets_have_the_counts_that_were_promised():
    counts = {
        name: (spec.train, spec.labeled, spec.val, spec.test)
        for name in PRESETS
        for spec in [preset_spec(name)]
    }
    assert counts == {
        "small": (1_000, 100, 200, 200),
        "v2": (100_000, 10_000, 10_000, 10_000),
        "paper": (100_000, 1_000, 100_000, 100_000),
    }
    assert preset_spec("small") == SplitSpec()
    assert preset_spec("paper", labeled=200).labeled == 200


def test_settings_that_are_not_given_follow_others():
    assert preset_spec("paper", train=5_000).labeled == 50
    assert preset_spec("v2", train=5_000).labeled == 500
    assert preset_spec("small", train=0).labeled == 0
    assert preset_spec("small", train=50, labeled=50).labeled == 50
    pixels = {
        side: preset_spec("small", height=side).min_cube_pixels for side in (16, 64, 128, 256)
    }
    assert pixels == {16: 1, 64: 3, 128: 12, 256: 12}
    assert preset_spec("small", height=256, width=512).min_cube_pixels == 48
    assert preset_spec("small", height=64, min_cube_pixels=0).min_cube_pixels == 0
    with pytest.raises(SpecError, match="preset: found large, expected one of small, v2, paper"):
        preset_spec("large")
    with pytest.raises(SpecError, match="train: found -5, expected"):
        preset_spec("v2", train=-5)


SIDES = st.integers(16, 600)


@given(SIDES, SIDES, st.floats(5, 90), st.floats(1.5, 10), st.integers(0, 2**32 - 1))
@settings(max_examples=60, deadline=None)
def test_no_point_of_the_bounding_sphere_leaves_the_image(height, width, fov, radius, seed):
    """And its outline comes within 3% of the nearer borders."""
    spec = SplitSpec(
        height=height, width=width, fov_degrees=fov, max_radius=radius, min_cube_pixels=0
    )
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(4000, 3))
    points *= radius / np.linalg.norm(points, axis=1, keepdims=True)
    # The outline, where the lines of sight touch the sphere, is where it reaches farthest.
    around, sine = rng.uniform(0, 2 * math.pi, 4000), radius / spec.camera_distance
    outline = np.stack([np.cos(around), np.sin(around), np.full(4000, sine)], axis=1)
    outline[:, :2] *= math.sqrt(1 - sine**2)
    camera = spec.camera
    assert camera.position == (0, 0, spec.camera_distance)
    matrix = np.linalg.inv(camera.world_from_camera)
    seen = np.concatenate([points, radius * outline]) @ matrix[:3, :3].T + matrix[:3, 3]
    assert (seen[:, 2] < 0).all()
    image = (seen * (1, -1, -1)) @ intrinsics(height, width, camera.fov_y_degrees).T
    pixels = image[:, :2] / image[:, 2:]
    off_centre = abs(pixels - (width / 2, height / 2)) / (min(height, width) / 2)
    assert 0.93 < off_centre.max() < 1


def test_chains_as_large_as_the_radius_allows_stay_inside_however_turned():
    """Corner by corner, in pixels."""
    shapes = random_shapes(np.random.default_rng(0), 300, 9, max_radius=3.5)
    shapes = shapes[bounding_radius(shapes) > 3.3]
    assert len(shapes) > 20
    corners = np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
    points = (shapes[:, :, None] + corners).reshape(len(shapes), -1, 3)
    points = points - box_centre(shapes)[:, None]
    spec = SplitSpec(height=96, width=160)
    for turn in Rotation.random(200, random_state=1).as_matrix():
        x, y, z = np.moveaxis(points @ turn.T, 2, 0)
        scale = 48 / math.tan(math.radians(spec.camera.fov_y_degrees / 2))
        depth = spec.camera_distance - z
        assert (abs(scale * x / depth) < 80).all()
        assert (abs(scale * y / depth) < 48).all()


def test_an_edge_has_the_length_in_pixels_that_is_said():
    for height, width in ((128, 128), (64, 96), (160, 96)):
        spec = SplitSpec(height=height, width=width, min_cube_pixels=1)
        focal = intrinsics(height, width, spec.camera.fov_y_degrees)[0, 0]
        assert spec.pixels_per_edge == pytest.approx(focal / spec.camera_distance)
        assert spec.light_distance > spec.camera_distance + spec.max_radius


def test_no_surface_can_be_as_bright_as_the_background_by_default():
    """Nearest to all lights, facing them all."""
    spec = SplitSpec()
    nearer = spec.light_distance / (spec.light_distance - spec.max_radius)
    brightest = 0.8 * (0.25 + spec.light_level * nearer**2)
    assert (spec.reflectance, spec.ambient) == ((0.8,) * 3, (0.25,) * 3)
    assert 0.9 < brightest < 0.98 < min(spec.background)
