"""Settings of closed rooms, and the description of one."""

import json

import pytest

from scenegen.common.errors import SpecError
from scenegen.description.interiors import Interior, Opening
from scenegen.description.presets import preset_spec
from scenegen.description.specs import DatasetSpec

NAMES_OF_1_0 = [
    "allow_cropped", "ambient", "attenuation", "camera_radius", "camera_target",
    "fov_degrees", "height", "image_dtype", "light_level", "light_radius",
    "light_saturation", "lights", "listing", "min_visible_pixels", "object_radius",
    "object_split", "objects", "pose", "random_reflectance", "reflectance",
    "room_reflectance", "seed", "shading", "shadows", "shapes", "shininess", "source",
    "specular", "spp", "views", "width",
]  # fmt: skip
CHANGED = [
    "fov_degrees", "height", "min_visible_pixels", "objects", "shapes", "source", "spp", "width",
]  # fmt: skip


@pytest.mark.parametrize(
    ("preset", "settings"),
    [
        *(("shapes", {name: value}) for name, value in
          (("hours", (9, 10)), ("denoise", True), ("sensor_noise", 0.1), ("materials", "0" * 16))),
        *(("interiors", {"objects": value}) for value in ((500, 500), (0, 3), (12, 100))),
        *(("interiors", {name: value}) for name, value in
          (("hours", (20, 25)), ("shading", "paper"), ("shapes", ("unicorn",)),
           ("shadows", True), ("lights", (1, 1)))),
        ("interiors", {"source": "shapes", "shapes": ("box",)}),
    ],
)  # fmt: skip
def test_settings_that_a_kind_of_rooms_cannot_have_are_refused(preset, settings):
    with pytest.raises(SpecError):
        preset_spec(preset, **settings)


def test_requests_that_leave_later_settings_alone_have_the_json_of_1_0():
    """Another text would be another fingerprint, and `verify` of published files would fail."""
    assert sorted(json.loads(preset_spec("shapes").to_json())) == NAMES_OF_1_0
    settings = json.loads(preset_spec("interiors").to_json())
    assert sorted(settings) == sorted([*NAMES_OF_1_0, "fov_spread_degrees", "interior"])
    usual = json.loads(DatasetSpec().to_json()) | {"shading": "path", "interior": True}
    assert {k for k, v in settings.items() if usual.get(k) != v} == {*CHANGED, "fov_spread_degrees"}


def interior(**changes):
    told = {
        "size": (4.0, 2.5, 3.0), "openings": (), "stands_on": (0, 1), "hour": 12.0,
        "facing_degrees": 0.0, "lit": False,
    }  # fmt: skip
    return Interior(**{**told, **changes})


@pytest.mark.parametrize(
    "changes",
    [{"size": (0.0, 2.5, 3.0)}, {"stands_on": (1, 0)}, {"stands_on": (0, 3)}, {"hour": 25.0}],
)
def test_impossible_rooms_are_refused(changes):
    interior()
    with pytest.raises(SpecError):
        interior(**changes)


def test_an_opening_is_a_rectangle_in_a_wall():
    Opening("door", "west", 0.5, 1.4, 0.0, 2.0)
    for wrong in (("hole", "west", 0.5, 1.4), ("door", "up", 0.5, 1.4), ("door", "west", 1.4, 0.5)):
        with pytest.raises(SpecError):
            Opening(*wrong, 0.0, 2.0)
