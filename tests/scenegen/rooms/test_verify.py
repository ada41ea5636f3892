"""`scenegen verify` passes good files and fails on each kind of damage at the right check.

Whatever a row holds, it never ends in a traceback.
"""

import re

import h5py
import numpy as np
import pytest
from h5_edits import attribute, damaged_chunk, edit_scene, put, swap_rows, values

from scenegen.rendering.backend import VERSION_ATTRIBUTES
from scenegen.rooms.verify import verify_file

ROWS = {"layout", "content", "description", "depth", "normal", "object_id", "image", "fingerprint"}
ALL = ROWS | {"drawn again from the seed", "rendered again"}


def failed(checks):
    return {name for name, word in checks.items() if word == "FAIL"}


@pytest.mark.parametrize("which", ["rooms_path", "float_path"])
def test_a_good_file_passes(verdict, request, which):
    path = request.getfixturevalue(which)
    code, checks, output = verdict(path)
    assert (code, failed(checks), set(checks)) == (0, set(), ALL)
    assert output.splitlines()[-1] == f"{path}: verified"
    assert "bit for bit" in output


@pytest.mark.parametrize(
    "settings",
    [
        {"image_dtype": "float16"},
        {"shadows": True, "spp": 3},
        {"objects": (0, 0), "lights": (0, 0)},
        {"pose": "any", "allow_cropped": True},
    ],
    ids=str,
)
def test_other_kinds_of_files_pass(verdict, make_rooms, tmp_path, settings):
    path = make_rooms(tmp_path / "x.h5", 3, **settings)
    code, checks, _ = verdict(path, "--items", 3)
    assert (code, failed(checks)) == (0, set())


OTHER_VERSION = {
    "the same": ({}, "bit for bit"),
    "another Mitsuba": ({"mitsuba_version": "3.8.1"}, "mitsuba_version 3.8.1"),
    "another LLVM": ({"llvm_version": "20.0.0"}, "llvm_version 20.0.0"),
    "another variant": ({"variant": "scalar_rgb"}, "variant scalar_rgb"),
    "an array": ({"mitsuba_version": np.array([3, 8])}, "mitsuba_version [3 8]"),
    "none stored": (dict.fromkeys(VERSION_ATTRIBUTES), "mitsuba_version not stored"),
}


def nudged(name, by):
    return values(name, lambda array: array + array.dtype.type(by))


@pytest.mark.parametrize("versions", OTHER_VERSION)
@pytest.mark.parametrize(
    ("edit", "alike"),
    [
        (lambda file: None, True),
        (nudged("depth", 1e-7), True),
        (nudged("depth", 1e-2), False),
        (nudged("normal", 5e-4), True),
        (nudged("normal", 5e-3), False),
        (nudged("image", 1), True),
        (nudged("image", 3), False),
        (put("object_id", (5, 7, 9), 3), True),
        (put("object_id", (5, 7, slice(9, 13)), 3), False),
    ],
    ids=["as rendered", "depth 1e-7", "depth 1e-2", "normal 5e-4", "normal 5e-3", "image 1",
         "image 3", "one id", "four ids"],
)  # fmt: skip
def test_other_versions_are_told_and_compared_within_a_tolerance(damaged, versions, edit, alike):
    """With the same versions a single bit counts."""
    attributes, remark = OTHER_VERSION[versions]

    def spoil(file):
        before = {name: file[name][:] for name in ("image", "depth", "normal", "object_id")}
        edit(file)
        spoil.changed = any((before[name] != file[name][:]).any() for name in before)
        for name, value in attributes.items():
            del file.attrs[name]
            if value is not None:
                file.attrs[name] = value

    path = damaged(spoil)
    again = {check.name: check for check in verify_file(path, 8)}["rendered again"]
    assert again.ok == (alike if attributes else not spoil.changed), again.detail
    assert remark in again.detail or not attributes


@pytest.mark.parametrize(
    ("settings", "factor", "alike"),
    [
        ({"image_dtype": "float32"}, 1 + 5e-5, True),
        ({"image_dtype": "float32"}, 1 + 1e-3, False),
        ({"image_dtype": "float16"}, 1 + 2.0**-11, True),
        ({"image_dtype": "float16"}, 1 + 2.0**-8, False),
        ({"shading": "path", "spp": 2}, 0.95, True),
        ({"shading": "path", "spp": 2}, 0.5, False),
    ],
    ids=str,
)
def test_images_of_other_versions(make_rooms, tmp_path, settings, factor, alike):
    """Floats relative to the radiance; images of a path tracer by the mean of each channel."""
    path = make_rooms(tmp_path / "x.h5", 2, **settings)
    with h5py.File(path, "r+") as file:
        file.attrs["drjit_version"] = "1.4.0"
        file["image"][...] = (file["image"][:] * factor).astype(file["image"].dtype)
    again = {check.name: check for check in verify_file(path, 8)}["rendered again"]
    assert again.ok == alike, again.detail


def test_lists_and_counts(verdict, rooms_path):
    assert set(verdict(rooms_path, "--items", 0)[1]) == ROWS
    assert "3 rows, bit for bit" in verdict(rooms_path, "--items", 3)[2]
    assert "8 rows, bit for bit" in verdict(rooms_path, "--items", 99)[2]


def shifted_ids(ids):
    return np.where(ids > 0, ids + 1, ids)


def move_light(scene):
    scene["lights"][0]["position"][0] += 0.01


def other_shape(scene):
    scene["objects"][0]["shape"] = "box" if scene["objects"][0]["shape"] != "box" else "cone"


def row_5(name, change):
    """Other values in row 5 of a dataset."""
    return lambda file: file[name].__setitem__(5, change(file[name][5]))


PIXEL = (5, 7, 9)
DAMAGE = {
    "depth scaled": (row_5("depth", lambda v: v * np.float32(1.001)), {"image", "rendered again"}),
    "one NaN in depth": (put("depth", PIXEL, np.nan), {"depth", "rendered again"}),
    "one infinite depth": (put("depth", PIXEL, np.inf), {"depth"}),
    "normal flipped": (row_5("normal", np.negative), {"normal", "rendered again"}),
    "normal too short": (row_5("normal", lambda v: v * np.float32(0.9999)), {"normal"}),
    "normals turned": (row_5("normal", lambda v: v[..., [1, 0, 2]]), {"image"}),
    "object_id off by one": (row_5("object_id", shifted_ids), {"object_id", "rendered again"}),
    "one object_id": (put("object_id", (5, 0, 0), -1), {"depth", "normal", "rendered again"}),
    "image changed by 2 levels": (
        values("image", lambda v: v + np.uint8(2)), {"image", "rendered again"},
    ),
    "a light moved in the JSON": (edit_scene(5, move_light), {"description", "fingerprint"}),
    "a shape changed in the JSON": (edit_scene(5, other_shape), {"description", "fingerprint"}),
    "camera matrix": (row_5("camera/world_from_camera", lambda v: v + 1e-6), {"description"}),
    "fingerprint": (attribute("fingerprint", "0" * 64), {"fingerprint"}),
    "the spec's seed": (
        lambda file: file.attrs.update(spec=file.attrs["spec"].replace('"seed":3', '"seed":4')),
        {"fingerprint", "drawn again from the seed"},
    ),
    "all of two rows swapped": (swap_rows(2, 5), {"fingerprint"}),
    "two images swapped": (swap_rows(2, 5, "image"), {"image", "rendered again"}),
    "two depth maps swapped": (swap_rows(2, 5, "depth"), {"image", "rendered again"}),
    "two scenes swapped": (swap_rows(2, 5, "scene"), {"description", "fingerprint"}),
    "two indices swapped": (swap_rows(2, 5, "scene_index"), {"description"}),
    "count of visible pixels": (swap_rows(2, 5, "object/visible_pixels"), {"object_id"}),
    "a view that the scene does not have": (put("view_index", 5, 1), {"description"}),
    "a view below 0": (put("view_index", 5, -1), {"description"}),
    "a view far beyond": (put("view_index", 5, 2**31 - 1), {"description"}),
}  # fmt: skip


@pytest.mark.parametrize("kind", DAMAGE)
def test_damage_fails_at_the_right_check(verdict, damaged, kind):
    edit, expected = DAMAGE[kind]
    path = damaged(edit)
    code, checks, output = verdict(path)
    assert code == 1
    assert expected <= failed(checks), output
    assert set(checks) == ALL, "the other checks are still made"
    if kind not in ("fingerprint", "the spec's seed", "all of two rows swapped"):
        assert "row 5" in output
    code, checks, _ = verdict(path, "--items", 0)
    assert code == 1
    assert expected & set(checks) <= failed(checks), "found without rendering, too"


@pytest.mark.parametrize(
    "text", ["{", "", "null", "{}", '"x"', "[1]", b"\xff\xfe", '{"index":5}', "{" * 9000]
)
def test_unreadable_descriptions_fail_a_check(verdict, damaged, text):
    code, checks, output = verdict(damaged(lambda file: file["scene"].__setitem__(5, text)))
    assert code == 1
    assert {"description", "fingerprint"} <= failed(checks)
    assert "row 5" in output


@pytest.mark.parametrize(
    "change",
    [
        lambda scene: scene["cameras"].clear(),
        lambda scene: scene["cameras"][0].update(position=["a", 1, 2]),
        lambda scene: scene["cameras"][0].update(position=[0.3, 2, 0.3]),
        lambda scene: scene["objects"][0].update(rotation=[1]),
        lambda scene: scene["objects"][0].update(scale="x"),
        lambda scene: scene["objects"][0].update(scale=0),
        lambda scene: scene["objects"][0].update(shape="foo"),
        lambda scene: scene["objects"][0].update(shape=3),
        lambda scene: scene.update(ambient=3),
        lambda scene: scene.update(objects=scene["objects"] * 9),
        lambda scene: scene.update(index=-5),
        lambda scene: scene.update(index="a"),
        lambda scene: scene["lights"][0].update(position=[float("nan")] * 3),
    ],
)
def test_impossible_descriptions_fail_a_check(verdict, damaged, change):
    code, checks, output = verdict(damaged(edit_scene(5, change)))
    assert code == 1
    assert {"description", "fingerprint"} <= failed(checks)
    assert "row 5" in output


@pytest.mark.parametrize("name", ["image", "depth", "normal", "object_id"])
def test_a_damaged_chunk_fails_a_check_that_names_it(verdict, damaged, name):
    path = damaged(damaged_chunk(name, 5))
    with h5py.File(path) as file, pytest.raises(OSError, match="filter"):
        file[name][5]
    code, checks, output = verdict(path)
    assert code == 1
    assert failed(checks)
    assert re.search(rf"{name}.*row 5|row 5.*{name}", output), output


@pytest.mark.parametrize(
    ("name", "attribute", "value"),
    [
        ("image", "scale", 1.0),
        ("object/shape", "names", ["cone", "box"]),
        ("depth", "unit", "metre"),
        ("normal", "frame", "world"),
    ],
)
def test_attributes_that_lie_fail_the_layout(verdict, damaged, name, attribute, value):
    """A reader with plain h5py believes them."""
    path = damaged(lambda file: file[name].attrs.update({attribute: value}))
    code, checks, _ = verdict(path)
    assert code == 1
    assert "layout" in failed(checks)


@pytest.mark.parametrize("settings", [{"shadows": True}, {"spp": 4}], ids=str)
@pytest.mark.parametrize("name", ["depth", "image"])
def test_shadows_and_samples_do_not_switch_the_checks_off(
    verdict, make_rooms, tmp_path, settings, name
):
    """Surfels of the room lie on its planes, and no image is darker than ambient light alone."""
    path = make_rooms(tmp_path / "x.h5", 3, **settings)
    with h5py.File(path, "r+") as file:
        file[name][1] = file[name][1] * 1.01 if name == "depth" else file[name][1] // 20
    code, checks, _ = verdict(path, "--items", 0)
    assert code == 1
    assert name in failed(checks)
