"""Descriptions: JSON both ways, every setting guarded."""

import json
from dataclasses import fields
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scenegen.camera import Camera
from scenegen.common.errors import SpecError
from scenegen.description.names import SHAPE_NAMES
from scenegen.description.scenes import Light, PlacedObject, SceneSpec
from scenegen.description.specs import DatasetSpec, request_from_json
from scenegen.sampling.scenes import sample_scene

NUMBER = st.floats(-1e9, 1e9)
VECTOR = st.tuples(NUMBER, NUMBER, NUMBER)
QUATERNIONS = [(1.0, 0.0, 0.0, 0.0), (0.5, -0.5, 0.5, 0.5), (0.1, 0.7, -0.7, 0.1)]
UNIT = st.floats(0.0, 1.0)
COLOR = st.tuples(UNIT, UNIT, UNIT)
INSIDE = st.floats(0.01, 0.99)


def rising(values):
    return st.tuples(values, values).map(lambda pair: (min(pair), max(pair)))


CAMERAS = st.builds(Camera, VECTOR, st.just((0.3, 0.25, -0.1)), st.floats(1.0, 179.0))
OBJECTS = st.builds(
    PlacedObject,
    st.sampled_from([*SHAPE_NAMES, "mug/0001", "chair/ä b/c"]),
    VECTOR,
    st.sampled_from(QUATERNIONS),
    st.floats(1e-6, 1e3),
    VECTOR,
    st.floats(0.0, 10.0),
    st.floats(1.0, 1e4),
    st.text("0123456789abcdef", max_size=16),
)
SCENES = st.builds(
    SceneSpec,
    index=st.integers(0, 2**40),
    cameras=st.lists(CAMERAS, min_size=1, max_size=2).map(tuple),
    objects=st.lists(OBJECTS, max_size=3).map(tuple),
    lights=st.lists(st.builds(Light, VECTOR, VECTOR), max_size=3).map(tuple),
    ambient=VECTOR,
    attenuation=st.tuples(NUMBER, NUMBER),
    room_reflectance=st.none() | VECTOR,
    background=VECTOR,
)
DATASETS = st.builds(
    DatasetSpec,
    seed=st.integers(0, 2**63 - 1),
    height=st.integers(8, 4096),
    width=st.integers(8, 4096),
    objects=rising(st.integers(0, 100)),
    shapes=st.lists(st.sampled_from(SHAPE_NAMES), min_size=1, unique=True).map(tuple),
    object_radius=rising(st.floats(0.005, 0.5)),
    pose=st.sampled_from(["resting", "any"]),
    lights=rising(st.integers(0, 16)),
    shadows=st.booleans(),
    spp=st.integers(1, 1024),
    image_dtype=st.sampled_from(["uint8", "float16", "float32"]),
    min_visible_pixels=st.integers(0, 64),
    allow_cropped=st.booleans(),
    fov_degrees=st.floats(1.0, 120.0),
    principal_point=st.tuples(st.floats(-1.5, 2.5), st.floats(-1.5, 2.5)),
    pixel_aspect=st.floats(0.25, 4.0),
    stereo=st.floats(0.0, 0.25),
    camera_radius=st.floats(2.0, 10.0),
    camera_target=st.tuples(INSIDE, INSIDE, INSIDE),
    light_radius=st.floats(2.0, 100.0),
    light_level=st.floats(0.0, 100.0),
    ambient=COLOR,
    attenuation=st.tuples(st.floats(0.1, 9.0), st.floats(0.0, 9.0)),
    reflectance=COLOR,
    room_reflectance=COLOR,
    random_reflectance=st.booleans(),
    specular=rising(st.floats(0.0, 10.0)),
    shininess=rising(st.floats(1.0, 10_000.0)),
    light_saturation=UNIT,
    views=st.lists(st.floats(0.1, 80.0), unique=True, max_size=5).map(
        lambda some: (0.0, *sorted(some))
    ),
)

NAN, INF = float("nan"), float("inf")
OUT_OF_RANGE: dict[str, list[Any]] = {
    "seed": [-1, 2**63],
    "height": [7, 2**17 + 1],
    "width": [7, 2**17 + 1],
    "objects": [(-1, 2), (3, 2), (1, 101)],
    "shapes": [(), ("box", "cube"), ("box", "box")],
    "object_radius": [(0.004, 0.1), (0.1, 0.51), (0.2, 0.1), (0.1, NAN), (NAN, 0.1)],
    "pose": ["flying"],
    "lights": [(-1, 1), (1, 17), (2, 1)],
    "spp": [0, 1025],
    "image_dtype": ["uint16"],
    "min_visible_pixels": [-1, 128 * 128 + 1],
    "fov_degrees": [0.9, 121.0, NAN],
    "principal_point": [(0.5, -1.6), (2.6, 0.5), (0.5,), (NAN, 0.5)],
    "pixel_aspect": [0.2, 4.1, NAN],
    "projection": ["fisheye", "equirectangular"],
    "stereo": [-0.1, 0.26, NAN],
    "fov_spread_degrees": [-1.0, 92.5, NAN],
    "camera_radius": [1.0, 10.1, NAN],
    "camera_target": [(0.3, 0.0, 0.3), (0.3, 0.3, 1.0), (NAN, 0.3, 0.3)],
    "light_radius": [1.0, 101.0, INF],
    "light_level": [-0.1, 101.0, NAN],
    "ambient": [(0.1, 1.1, 0.1), (-0.1, 0.1, 0.1), (0.1, 0.1, NAN)],
    "attenuation": [(-0.1, 1.0), (1.0, -0.1), (0.0, 0.0), (NAN, 1.0), (1.0, NAN)],
    "source": ["meshes"],
    "object_split": ["dev", "train"],
    "views": [(), (5.0,), (0.0, 5.0, 5.0), (0.0, 80.1), (0.0, -5.0), (0.0, NAN)],
    "shading": ["phong"],
    "light_saturation": [-0.1, 1.1, NAN],
    "room_reflectance": [(0.1, 0.1, 1.1), (-0.1, 0.1, 0.1), (NAN, 0.1, 0.1)],
    "specular": [(-0.1, 0.1), (0.2, 0.1), (0.0, 10.1), (0.0, NAN)],
    "shininess": [(0.9, 2.0), (3.0, 2.0), (1.0, 10_001.0), (NAN, 2.0)],
    "reflectance": [(0.1, 0.1, 1.1), (-0.1, 0.1, 0.1), (NAN, 0.1, 0.1)],
}
# Where an error names another thing than the field.
SHOWN = {"height": "size", "width": "size", "fov_degrees": "fov", "fov_spread_degrees": "fov"}


@settings(deadline=None)
@given(scene=SCENES)
def test_scene_json_keeps_every_bit(scene):
    again = SceneSpec.from_json(scene.to_json())
    assert again == scene
    assert again.to_json() == scene.to_json()
    assert hash(again) == hash(scene), "tuples, not lists"
    assert "\n" not in scene.to_json()


@settings(deadline=None)
@given(spec=DATASETS)
def test_request_json_keeps_every_bit(spec):
    again = request_from_json(spec.to_json())
    assert again == spec
    assert hash(again) == hash(spec)
    assert again.to_json() == spec.to_json()


@pytest.mark.parametrize(
    ("field", "value"), [(field, value) for field, some in OUT_OF_RANGE.items() for value in some]
)
def test_a_setting_out_of_range_is_named(field, value):
    name = SHOWN.get(field, field.replace("_", " "))
    with pytest.raises(SpecError) as caught:
        DatasetSpec(**{field: value})
    assert caught.value.where == name
    assert caught.value.found
    assert caught.value.expected
    request = json.loads(DatasetSpec().to_json()) | {field: value}
    with pytest.raises(SpecError) as caught:
        request_from_json(json.dumps(request))
    assert caught.value.where.startswith(name)


@pytest.mark.parametrize(
    "settings",
    [
        {"shadows": True, "shading": "path"},
        {"attenuation": (1.0,)},
        {"attenuation": (1.0, 2.0, 3.0)},
        {"attenuation": (0.0, 1e-300)},
        {"views": tuple(float(i) for i in range(65))},
        {"shapes": ("mug", ""), "source": "folder"},
        {"shapes": ("mug/1",), "source": "folder"},
        {"shapes": ("sphere",), "source": "families"},
        {"shapes": tuple(map(str, range(4001))), "source": "folder"},
    ],
    ids=lambda settings: str(settings)[:50],
)
def test_settings_that_contradict_one_another_are_refused(settings):
    with pytest.raises(SpecError) as caught:
        DatasetSpec(**settings)
    assert caught.value.where in (*settings, "classes")


@pytest.mark.parametrize(
    "change",
    [
        {"cameras": ()},
        {"index": -1},
        {"objects": [{"shape": "cube"}]},
        {"objects": [{"shape": "mug/"}]},
        {"objects": [{"shape": "/0001"}]},
        {"objects": [{"specular": -0.1}]},
        {"objects": [{"shininess": 0.0}]},
        {"objects": [{"scale": 0.0}]},
        {"objects": [{"scale": -0.1}]},
        {"objects": [{"rotation": (1.0, 0.1, 0.0, 0.0)}]},
        {"cameras": [{"fov_y_degrees": 180.0}]},
        {"cameras": [{"fov_y_degrees": 0.0}]},
        {"cameras": [{"position": (0.3, 0.3, 0.3)}]},
    ],
    ids=str,
)
def test_what_no_scene_can_be_is_refused(change):
    scene = sample_scene(DatasetSpec(objects=(1, 1)), 0)
    assert scene is not None
    raw = json.loads(scene.to_json())
    assert SceneSpec.from_json(json.dumps(raw)) == scene
    ((name, value),) = change.items()
    nested = isinstance(value, list)
    raw[name] = [raw[name][0] | value[0]] if nested else value
    with pytest.raises(SpecError) as caught:
        SceneSpec.from_json(json.dumps(raw))
    key = next(iter(value[0])) if nested else name
    assert caught.value.where in (key, "camera")


def test_every_setting_with_a_range_is_tried_above():
    assert {f.name for f in fields(DatasetSpec)} - set(OUT_OF_RANGE) == {
        "shadows",
        "allow_cropped",
        "listing",
        "random_reflectance",
        "own_reflectance",
        "truth",
    }
