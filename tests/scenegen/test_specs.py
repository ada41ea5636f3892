"""Descriptions: JSON both ways, every setting guarded, fingerprints that notice every change."""

import hashlib
import json
from dataclasses import fields, replace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scenegen.camera import Camera
from scenegen.errors import SpecError
from scenegen.specs import (
    SHAPE_NAMES,
    DatasetSpec,
    Light,
    PlacedObject,
    SceneSpec,
    fingerprint,
)

NUMBER = st.floats(allow_nan=False, allow_infinity=False)
VECTOR = st.tuples(NUMBER, NUMBER, NUMBER)
UNIT = st.floats(0.0, 1.0)
COLOR = st.tuples(UNIT, UNIT, UNIT)
INSIDE = st.floats(0.01, 0.99)


def rising(values: st.SearchStrategy[Any]) -> st.SearchStrategy[tuple[Any, Any]]:
    return st.tuples(values, values).map(lambda pair: (min(pair), max(pair)))


SCENES = st.builds(
    SceneSpec,
    index=st.integers(0, 2**40),
    cameras=st.lists(st.builds(Camera, VECTOR, VECTOR, NUMBER), max_size=2).map(tuple),
    objects=st.lists(
        st.builds(
            PlacedObject,
            st.sampled_from(SHAPE_NAMES),
            VECTOR,
            st.tuples(NUMBER, NUMBER, NUMBER, NUMBER),
            NUMBER,
            VECTOR,
        ),
        max_size=3,
    ).map(tuple),
    lights=st.lists(st.builds(Light, VECTOR, VECTOR), max_size=3).map(tuple),
    ambient=VECTOR,
    attenuation=st.tuples(NUMBER, NUMBER),
    room_reflectance=VECTOR,
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
    camera_radius=st.floats(2.0, 10.0),
    camera_target=st.tuples(INSIDE, INSIDE, INSIDE),
    light_radius=st.floats(2.0, 100.0),
    light_level=st.floats(0.0, 100.0),
    ambient=COLOR,
    attenuation=st.tuples(st.floats(0.1, 9.0), st.floats(0.0, 9.0)),
    reflectance=COLOR,
)

NAN, INF = float("nan"), float("inf")
OUT_OF_RANGE: dict[str, list[Any]] = {
    "seed": [-1, 2**63],
    "height": [7, 2**17 + 1],
    "width": [7, 2**17 + 1],
    "objects": [(-1, 2), (3, 2), (1, 101), (1,)],
    "shapes": [(), ("box", "cube"), ("box", "box")],
    "object_radius": [(0.004, 0.1), (0.1, 0.51), (0.2, 0.1), (0.1, NAN), (NAN, 0.1)],
    "pose": ["flying"],
    "lights": [(-1, 1), (1, 17), (2, 1)],
    "spp": [0, 1025],
    "image_dtype": ["uint16"],
    "min_visible_pixels": [-1, 128 * 128 + 1],
    "fov_degrees": [0.9, 121.0, NAN],
    "camera_radius": [1.0, 10.1, NAN],
    "camera_target": [(0.3, 0.0, 0.3), (0.3, 0.3, 1.0), (NAN, 0.3, 0.3)],
    "light_radius": [1.0, 101.0, INF],
    "light_level": [-0.1, 101.0, NAN],
    "ambient": [(0.1, 1.1, 0.1), (-0.1, 0.1, 0.1), (0.1, 0.1, NAN)],
    "attenuation": [(-0.1, 1.0), (1.0, -0.1), (0.0, 0.0), (NAN, 1.0), (1.0, NAN)],
    "reflectance": [(0.1, 0.1, 1.1), (-0.1, 0.1, 0.1), (NAN, 0.1, 0.1)],
}
SHOWN = {"height": "size", "width": "size", "fov_degrees": "fov"}  # where not the field's name


@settings(deadline=None)
@given(scene=SCENES)
def test_scene_json_keeps_every_bit(scene: SceneSpec) -> None:
    again = SceneSpec.from_json(scene.to_json())
    assert again == scene
    assert again.to_json() == scene.to_json()
    assert hash(again) == hash(scene), "tuples, not lists"
    assert "\n" not in scene.to_json()


@settings(deadline=None)
@given(spec=DATASETS)
def test_request_json_keeps_every_bit(spec: DatasetSpec) -> None:
    again = DatasetSpec.from_json(spec.to_json())
    assert again == spec
    assert hash(again) == hash(spec)
    assert fingerprint(again, []) == fingerprint(spec, [])


@pytest.mark.parametrize(
    ("field", "value"), [(field, value) for field, some in OUT_OF_RANGE.items() for value in some]
)
def test_a_setting_out_of_range_is_named(field: str, value: Any) -> None:
    name = SHOWN.get(field, field.replace("_", " "))
    with pytest.raises(SpecError, match=f"^{name}: found .*expected "):
        DatasetSpec(**{field: value})
    request = json.loads(DatasetSpec().to_json()) | {field: value}
    with pytest.raises(SpecError, match=f"^{name}: "):
        DatasetSpec.from_json(json.dumps(request))


def test_every_setting_with_a_range_is_tried_above() -> None:
    assert {f.name for f in fields(DatasetSpec)} - set(OUT_OF_RANGE) == {"shadows", "allow_cropped"}


@pytest.mark.parametrize("text", ["", "{", "[]", "3", "null", '{"sed": 1}', '{"seed": "x"}'])
def test_what_is_no_request_is_refused(text: str) -> None:
    with pytest.raises(SpecError):
        DatasetSpec.from_json(text)


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"index": 0}', '{"cameras": 3}'])
def test_what_is_no_scene_is_refused(text: str) -> None:
    with pytest.raises(SpecError, match="scene description"):
        SceneSpec.from_json(text)


def test_changed_settings_tells_just_those() -> None:
    assert DatasetSpec().changed_settings() == {}
    assert DatasetSpec(seed=4, spp=2).changed_settings() == {"seed": 4, "spp": 2}


def test_slots_hold_the_most_and_are_never_none() -> None:
    full = DatasetSpec(objects=(1, 5), lights=(0, 4))
    assert (full.object_slots, full.light_slots) == (5, 4)
    empty = DatasetSpec(objects=(0, 0), lights=(0, 0))
    assert (empty.object_slots, empty.light_slots) == (1, 1)


def test_fingerprint_notices_every_setting() -> None:
    valid: dict[str, Any] = {"seed": 1, "height": 64, "width": 64}
    valid |= {"objects": (1, 4), "shapes": ("cone", "box")}
    valid |= {"object_radius": (0.1, 0.3), "pose": "any", "lights": (0, 3), "shadows": True}
    valid |= {"spp": 2, "image_dtype": "float32", "min_visible_pixels": 0, "allow_cropped": True}
    valid |= {"fov_degrees": 27.0, "camera_radius": 1.6, "camera_target": (0.3, 0.3, 0.31)}
    valid |= {"light_radius": 3.0, "light_level": 0.7, "ambient": (0.1, 0.1, 0.0)}
    valid |= {"attenuation": (0.5, 0.6), "reflectance": (0.8, 0.7, 0.8)}
    assert set(valid) == {f.name for f in fields(DatasetSpec)}
    changed = [replace(DatasetSpec(), **{name: value}) for name, value in valid.items()]
    reordered = replace(DatasetSpec(), shapes=("box", "cone"))  # objects draw shapes by position
    found = {fingerprint(spec, ["a"]) for spec in (DatasetSpec(), reordered, *changed)}
    assert len(found) == 2 + len(valid)


def test_fingerprint_notices_scenes_and_their_borders() -> None:
    lines: list[list[str]] = [[], ["a"], ["b"], ["a", "b"], ["b", "a"], ["ab"], ["a", ""]]
    assert len({fingerprint(DatasetSpec(), scene) for scene in lines}) == len(lines)


def test_fingerprint_is_what_files_hold_today() -> None:
    """SHA-256 over sorted, compact JSON and one line a scene; another definition breaks files."""
    settings_by_name = {f.name: getattr(DatasetSpec(), f.name) for f in fields(DatasetSpec)}
    request = json.dumps(settings_by_name, sort_keys=True, separators=(",", ":"))
    expected = hashlib.sha256("\n".join([request, "one", "two"]).encode()).hexdigest()
    assert fingerprint(DatasetSpec(), iter(["one", "two"])) == expected
