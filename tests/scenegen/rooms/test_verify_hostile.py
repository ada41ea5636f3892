"""`scenegen verify` says of any row, however broken, that it fails a check; it never breaks."""

import json
import re

import h5py
import pytest
from h5_edits import damaged_chunk


def failed(checks):
    return {name for name, word in checks.items() if word == "FAIL"}


def edit_scene(change):
    def edit(file):
        scene = json.loads(file["scene"].asstr()[5])
        change(scene)
        file["scene"][5] = json.dumps(scene, separators=(",", ":"))

    return edit


@pytest.mark.parametrize(
    "text", ["{", "", "null", "{}", '"x"', "[1]", b"\xff\xfe", '{"index":5}', "{" * 9000]
)
def test_unreadable_descriptions_fail_a_check(verdict, damaged, text):
    def edit(file):
        file["scene"][5] = text

    code, checks, output = verdict(damaged(edit))
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
    code, checks, output = verdict(damaged(edit_scene(change)))
    assert code == 1
    assert {"description", "fingerprint"} <= failed(checks)
    assert "row 5" in output


@pytest.mark.parametrize("view", [1, -1, 2**31 - 1])
def test_a_view_that_the_scene_does_not_have(verdict, damaged, view):
    def edit(file):
        file["view_index"][5] = view

    code, checks, output = verdict(damaged(edit))
    assert code == 1
    assert "description" in failed(checks)
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
