"""Fingerprints: equal for equal truth, different for anything else, and the same next year."""

import hashlib
import json
from dataclasses import fields, replace
from typing import Any

import pytest

from scenegen.description.specs import DatasetSpec, fingerprint


def test_fingerprint_notices_every_setting() -> None:
    valid: dict[str, Any] = {"seed": 1, "height": 64, "width": 64}
    valid |= {"objects": (1, 4), "shapes": ("cone", "box")}
    valid |= {"object_radius": (0.1, 0.3), "pose": "any", "lights": (0, 3), "shadows": True}
    valid |= {"spp": 2, "image_dtype": "float32", "min_visible_pixels": 0, "allow_cropped": True}
    valid |= {"fov_degrees": 27.0, "camera_radius": 1.6, "camera_target": (0.3, 0.3, 0.31)}
    valid |= {"light_radius": 3.0, "light_level": 0.7, "ambient": (0.1, 0.1, 0.0)}
    valid |= {"attenuation": (0.5, 0.6), "reflectance": (0.8, 0.7, 0.8)}
    valid |= {"room_reflectance": (0.8, 0.7, 0.8), "random_reflectance": True}
    valid |= {"specular": (0.1, 0.2), "shininess": (1.0, 9.0), "light_saturation": 0.5}
    valid |= {"views": (0.0, 5.0), "shading": "path", "listing": "ab"}
    several = {"source", "object_split"}  # these need others beside them
    mugs = DatasetSpec(source="families", shapes=("mug",))
    assert set(valid) | several == {f.name for f in fields(DatasetSpec)}
    changed = [replace(DatasetSpec(), **{name: value}) for name, value in valid.items()]
    reordered = replace(DatasetSpec(), shapes=("box", "cone"))  # objects draw shapes by position
    found = {fingerprint(spec, ["a"]) for spec in (DatasetSpec(), reordered, *changed)}
    found |= {fingerprint(spec, ["a"]) for spec in (mugs, replace(mugs, object_split="val"))}
    assert len(found) == 4 + len(valid)


def test_fingerprint_notices_scenes_and_their_borders() -> None:
    lines: list[list[str]] = [[], ["a"], ["b"], ["a", "b"], ["b", "a"], ["ab"], ["a", ""]]
    assert len({fingerprint(DatasetSpec(), scene) for scene in lines}) == len(lines)


def test_fingerprint_is_what_files_hold_today() -> None:
    """SHA-256 over sorted, compact JSON and one line a scene; another definition breaks files."""
    settings_by_name = {f.name: getattr(DatasetSpec(), f.name) for f in fields(DatasetSpec)}
    request = json.dumps(settings_by_name, sort_keys=True, separators=(",", ":"))
    expected = hashlib.sha256("\n".join([request, "one", "two"]).encode()).hexdigest()
    assert fingerprint(DatasetSpec(), iter(["one", "two"])) == expected


@pytest.mark.parametrize(
    "settings", [{"fov_degrees": 28}, {"attenuation": (0, 1)}, {"ambient": (0.0, -0.0, 0.0)}]
)
def test_equal_requests_have_equal_fingerprints(settings: dict[str, Any]) -> None:
    spec = DatasetSpec(**settings)
    as_floats = {
        name: tuple(abs(float(v)) for v in value) if isinstance(value, tuple) else float(value)
        for name, value in settings.items()
    }
    equal = DatasetSpec(**as_floats)
    assert spec == equal
    assert fingerprint(spec, []) == fingerprint(equal, [])
