"""The settings of a split: the range of each, JSON both ways, and the one camera."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from refusals import refused

from iqtt.questions.kinds import DISTRACTOR_KINDS, QUESTION_KINDS, question_kind
from iqtt.questions.specs import SplitSpec, preset_spec
from scenegen.camera import intrinsics
from scenegen.common.errors import SpecError

NAN, INF = math.nan, math.inf
REFUSED = {
    "seed": ("seed", (-1, 2**256)),
    "train": ("train", (-1, 10**8 + 1)),
    "val": ("val", (-1, 10**8 + 1)),
    "test": ("test", (-1, 10**8 + 1)),
    "labeled": ("labeled", (-1, 1001)),
    "cubes": ("cubes", ((2, 5), (5, 17), (7, 6), (-3, 3))),
    "shapes": ("shapes", ("ring",)),
    "distractors": ("distractors", ("",)),
    "answers": ("answers", (1, 4)),
    "height": ("size", (15, 4097)),
    "width": ("size", (15, 4097)),
    "image_dtype": ("image dtype", ("int8",)),
    "min_angle_degrees": ("min angle", (-0.5, 90.5, NAN)),
    "min_sight_angle_degrees": ("min sight angle", (-0.5, 60.5, NAN)),
    "min_cube_pixels": ("min cube pixels", (-1, 61)),
    "max_radius": ("max radius", (0.0, -3.5, 1.49, 10.5, NAN, INF)),
    "lights": ("lights", ((0, 2), (3, 2), (1, 17))),
    "fov_degrees": ("fov", (0.0, 4.9, 90.5, 360.0, NAN)),
    "light_level": ("light level", (-0.1, 100.5, NAN)),
    **{
        name: (name, ((0.0, 0.0, 1.1), (-0.1, 0.0, 0.0), (0.0, NAN, 0.0)))
        for name in ("background", "ambient", "reflectance")
    },
}


@pytest.mark.parametrize("setting", REFUSED)
def test_a_setting_out_of_range_is_refused(setting):
    where, values = REFUSED[setting]
    for value in values:
        with pytest.raises(SpecError) as error:
            SplitSpec(**{setting: value})
        assert error.value.where == where
        assert error.value.found
        assert error.value.expected
    with pytest.raises(SpecError) as error:
        SplitSpec(height=64, min_cube_pixels=16)
    assert error.value.expected.startswith("from 0 to 14 pixels"), "it depends on the image's size"


def test_the_public_request_is_the_same_but_for_its_seed():
    specs = [SplitSpec(seed=seed, val=7) for seed in (0, 3, 2**62)]
    public = {spec.public() for spec in specs}
    assert len(public) == 1
    assert public == {SplitSpec(seed=None, val=7)}
    assert '"seed":null' in specs[1].public().to_json()
    assert SplitSpec.from_json(specs[1].public().to_json()) == specs[1].public()


def test_settings_that_are_not_given_follow_others():
    assert preset_spec("small") == SplitSpec()
    for (preset, told), (name, expected) in {
        ("paper", ("train", 5_000)): ("labeled", 50),
        ("v2", ("train", 5_000)): ("labeled", 500),
        ("small", ("train", 0)): ("labeled", 0),
        ("v2", ("train", 1)): ("min_sight_angle_degrees", 0),
        ("v2", ("min_sight_angle_degrees", 20)): ("min_sight_angle_degrees", 20),
        ("small", ("height", 16)): ("min_cube_pixels", 1),
        ("small", ("height", 64)): ("min_cube_pixels", 8),
        ("small", ("height", 256)): ("min_cube_pixels", 30),
        ("small", ("min_cube_pixels", 0)): ("min_cube_pixels", 0),
    }.items():
        assert getattr(preset_spec(preset, **dict([told])), name) == expected
    assert preset_spec("small", height=256, width=512).min_cube_pixels == 120
    with refused(SpecError, "preset"):
        preset_spec("large")
    with refused(SpecError, "train"):
        preset_spec("v2", train=-5)


@pytest.mark.parametrize(
    ("kinds", "expected"),
    [
        ([-1, 0, 0], "other"), ([1, -1, 1], "near"), ([2, 1, -1], "mirror"),
        ([3, 3, -1], "matched"), ([2, -1, 2], "mirror-pair"),
        ([-1, 2], "mirror-pair-2"), ([0, -1], "other-2"),
        ([3, -1], "matched-2"), (np.array([-1, 1, 2], np.int8), "mirror"),
    ],
)  # fmt: skip
def test_the_kind_of_a_question_follows_from_those_of_its_answers(kinds, expected):
    assert question_kind(kinds) == expected


def test_kinds_of_questions():
    mixed = SplitSpec()
    assert mixed.kinds == tuple(QUESTION_KINDS)
    assert replace(mixed, answers=2).kinds == ("other", "near", "matched", "mirror-pair")
    assert replace(mixed, distractors="near").kinds == ("near",)
    with refused(SpecError, "answers"):
        SplitSpec(distractors="mirror", answers=2)
    for kinds, error in (([-1, -1, -1], ValueError), ([-1, len(DISTRACTOR_KINDS)], IndexError)):
        with pytest.raises(error):
            question_kind(kinds)


SIDES = st.integers(16, 600)


@given(SIDES, SIDES, st.floats(5, 90), st.floats(1.5, 10), st.integers(0, 2**32 - 1))
@settings(max_examples=60)
def test_no_pixel_of_the_border_shows_the_bounding_sphere(height, width, fov, radius, seed):
    """And its outline comes near the nearer borders: within 7%, in small images a few pixels."""
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
    camera = spec.camera(spec.framing_distance(radius))
    assert camera.position == (0, 0, spec.camera_distance)
    matrix = np.linalg.inv(camera.world_from_camera)
    seen = np.concatenate([points, radius * outline]) @ matrix[:3, :3].T + matrix[:3, 3]
    assert (seen[:, 2] < 0).all()
    image = (seen * (1, -1, -1)) @ intrinsics(
        height, width, camera.fov_y_degrees, pixel_centers="half"
    ).T
    pixels = image[:, :2] / image[:, 2:]
    off_centre = abs(pixels - (width / 2, height / 2)) / (min(height, width) / 2)
    side = min(height, width)
    assert 0.93 - 3 / side < off_centre.max() < 1 - 1 / side
