"""`scenegen verify` passes good files, and fails on each kind of damage at the right check."""

import json

import numpy as np
import pytest
from h5_edits import put, values

from scenegen.rendering.backend import VERSION_ATTRIBUTES
from scenegen.rooms.verify import verify_file

ALL = {
    "layout",
    "description",
    "depth",
    "normal",
    "object_id",
    "image",
    "fingerprint",
    "drawn again from the seed",
    "rendered again",
}


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
    "none stored": (dict.fromkeys(VERSION_ATTRIBUTES), "mitsuba_version not stored"),
}


def nudge_depth(by):
    return lambda file: file["depth"].write_direct(file["depth"][:] + np.float32(by))


def nudge_image(by):
    return lambda file: file["image"].write_direct((file["image"][:].astype(int) + by).astype("u1"))


@pytest.mark.parametrize("versions", OTHER_VERSION)
@pytest.mark.parametrize(
    ("edit", "alike"),
    [
        (lambda file: None, True),
        (nudge_depth(1e-7), True),
        (nudge_depth(1e-2), False),
        (values("normal", lambda v: v + np.float32(5e-4)), True),
        (values("normal", lambda v: v + np.float32(5e-3)), False),
        (nudge_image(1), True),
        (nudge_image(3), False),
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


def test_lists_and_counts(verdict, rooms_path):
    assert set(verdict(rooms_path, "--items", 0)[1]) == ALL - {
        "drawn again from the seed",
        "rendered again",
    }
    assert "3 rows, bit for bit" in verdict(rooms_path, "--items", 3)[2]
    assert "8 rows, bit for bit" in verdict(rooms_path, "--items", 99)[2]


def scale_depth(file):
    file["depth"][5] = file["depth"][5] * np.float32(1.001)


def one_nan(file):
    file["depth"][5, 7, 9] = np.nan


def infinite(file):
    file["depth"][5, 7, 9] = np.inf


def flip_normal(file):
    file["normal"][5, 7, 9] = -file["normal"][5, 7, 9]


def shorten_normal(file):
    file["normal"][5, 7, 9] = file["normal"][5, 7, 9] * np.float32(0.9999)


def turn_normals(file):
    file["normal"][5] = file["normal"][5][..., [1, 0, 2]]


def object_off_by_one(file):
    ids = file["object_id"][5]
    ids[ids > 0] += 1
    file["object_id"][5] = ids


def one_id(file):
    ids = file["object_id"][5]
    ids[0, 0] = -1
    file["object_id"][5] = ids


def brighten(file):
    image = file["image"][5]
    image[7, 9] += 2
    file["image"][5] = image


def edit_scene(change):
    def edit(file):
        scene = json.loads(file["scene"].asstr()[5])
        change(scene)
        file["scene"][5] = json.dumps(scene, separators=(",", ":"))

    return edit


def move_light(scene):
    scene["lights"][0]["position"][0] += 0.01


def other_shape(scene):
    scene["objects"][0]["shape"] = "box" if scene["objects"][0]["shape"] != "box" else "cone"


def move_camera(file):
    file["camera/world_from_camera"][5, 0, 3] += 1e-6


def forge_fingerprint(file):
    file.attrs["fingerprint"] = "0" * 64


def change_seed(file):
    file.attrs["spec"] = file.attrs["spec"].replace('"seed":3', '"seed":4')


def swap_rows(*names):
    def edit(file):
        found = []
        file.visititems(lambda name, x: found.append(name) if hasattr(x, "dtype") else None)
        for name in names or found:
            rows = file[name][:]
            rows[[2, 5]] = rows[[5, 2]]
            file[name][:] = rows

    return edit


DAMAGE = {
    "depth scaled": (scale_depth, {"image", "rendered again"}),
    "one NaN in depth": (one_nan, {"depth", "rendered again"}),
    "one infinite depth": (infinite, {"depth"}),
    "normal flipped": (flip_normal, {"normal", "rendered again"}),
    "normal too short": (shorten_normal, {"normal"}),
    "normals turned": (turn_normals, {"image"}),
    "object_id off by one": (object_off_by_one, {"object_id", "rendered again"}),
    "one object_id": (one_id, {"depth", "normal", "rendered again"}),
    "image changed by 2 levels": (brighten, {"image", "rendered again"}),
    "a light moved in the JSON": (edit_scene(move_light), {"description", "fingerprint"}),
    "a shape changed in the JSON": (edit_scene(other_shape), {"description", "fingerprint"}),
    "camera matrix": (move_camera, {"description"}),
    "fingerprint": (forge_fingerprint, {"fingerprint"}),
    "the spec's seed": (change_seed, {"fingerprint", "drawn again from the seed"}),
    "all of two rows swapped": (swap_rows(), {"fingerprint"}),
    "two images swapped": (swap_rows("image"), {"image", "rendered again"}),
    "two depth maps swapped": (swap_rows("depth"), {"image", "rendered again"}),
    "two scenes swapped": (swap_rows("scene"), {"description", "fingerprint"}),
    "two indices swapped": (swap_rows("scene_index"), {"description"}),
    "count of visible pixels": (swap_rows("object/visible_pixels"), {"object_id"}),
}


@pytest.mark.parametrize("kind", DAMAGE)
def test_damage_fails_at_the_right_check(verdict, damaged, kind):
    edit, expected = DAMAGE[kind]
    code, checks, output = verdict(damaged(edit))
    assert code == 1
    assert expected <= failed(checks), output
    assert set(checks) == ALL, "the other checks are still made"
    assert "checks failed" in output.splitlines()[-1]
    if "fingerprint" not in kind and "seed" not in kind:
        assert "row 5" in output or "row 2" in output or expected == {"fingerprint"}


@pytest.mark.parametrize("kind", DAMAGE)
def test_damage_to_a_row_is_found_without_rendering_it(verdict, damaged, kind):
    edit, expected = DAMAGE[kind]
    code, checks, _ = verdict(damaged(edit), "--items", 0)
    assert code == 1
    assert expected & set(checks) <= failed(checks)
