"""`scenegen verify` finds any changed bit of a file, and never ends in a traceback."""

import json
import shutil

import h5py
import numpy as np
import pytest
from h5_edits import attribute, edit_scene, gone, put, swap_rows, values
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from scenegen.common.errors import FileFormatError
from scenegen.files.content import CONTENT_DIGEST, SHA256, content_digest, datasets, seal
from scenegen.rooms.verify import verify_file


@pytest.fixture(scope="module")
def small(make_rooms, tmp_path_factory):
    """Two scenes of two views; no test changes the file."""
    path = tmp_path_factory.mktemp("small") / "small.h5"
    return make_rooms(path, 2, views=(0.0, 35.0), random_reflectance=True, specular=(0.1, 0.3))


def failures(path, items=0):
    return {check.name: check.detail for check in verify_file(path, items) if not check.ok}


@pytest.fixture
def spoilt(small, tmp_path):
    """Return what fails in a copy of the file after an edit."""

    def fail(edit, items=0):
        path = tmp_path / "spoilt.h5"
        shutil.copy(small, path)
        with h5py.File(path, "r+") as file:
            edit(file)
        return failures(path, items)

    return fail


def one_bit(array):
    """The lowest bit of the last value, or the last letter of the last text, changed."""
    if array.dtype.kind == "O":
        last = array.reshape(-1)[-1:]
        last[0] = bytes([*last[0][:-1], (last[0] or b"a")[-1] ^ 1])
    else:
        array.reshape(-1).view(np.uint8)[-array.dtype.itemsize] ^= 1
    return array


def changed(item, name):
    """Another value of an attribute, of the same type."""
    value = item.attrs[name]
    if isinstance(value, str):
        item.attrs[name] = value + "x"
    elif np.asarray(value).dtype.kind in "iuf":
        item.attrs.modify(name, value + 1)
    else:
        del item.attrs[name]


EDITS = {
    "rows swapped": swap_rows(0, 3),
    "rows of light/color swapped": swap_rows(0, 3, "light/color"),
    "a dataset more": lambda file: file.create_dataset("more", data=1),
    "an empty dataset more": lambda file: file.create_dataset("more", data=h5py.Empty("f4")),
    "a type more": lambda file: file.__setitem__("more", np.dtype("f4")),
    "a reference more": lambda file: file.create_dataset("more", data=file["depth"].ref),
    "another name of a dataset": lambda file: file.__setitem__("zz", file["depth"]),
    "another name of a group": lambda file: file.__setitem__("camera/zz", file["light"]),
    "a name of the root": lambda file: file.__setitem__("zz", file["/"]),
    "a dataset less": gone("y"),
    "a group more": lambda file: file.create_group("more"),
    "an attribute of a group more": lambda file: file["camera"].attrs.update(x=1),
}


def edits_of(path):
    """Yield a name and an edit for each dataset, and several for each attribute of root and one."""
    with h5py.File(path) as file:
        for name, dataset in datasets(file):
            yield f"bit of {name}", values(name, one_bit)
        for name in ("/", "depth", "y"):
            yield f"new {name}@x", lambda f, n=name: f[n].attrs.update(x=1)
            for key in file[name].attrs:
                yield f"other {name}@{key}", lambda f, n=name, k=key: changed(f[n], k)
                yield f"no {name}@{key}", lambda f, n=name, k=key: f[n].attrs.__delitem__(k)
    yield from EDITS.items()


def test_every_changed_bit_is_found(small, spoilt):
    """But for the root's attributes without which a file is no file of rooms: these are refused."""
    missed, refused = [], []
    for what, edit in edits_of(small):
        try:
            found = spoilt(edit).get("content", "")
        except FileFormatError:
            refused.append(what)
            continue
        if not found or (what.startswith("bit of ") and f"{what[7:]}: " not in found):
            missed.append(what)
    assert not missed
    assert {what.partition("@")[0] for what in refused} == {"other /", "no /"}


def test_every_attribute_of_a_dataset_is_found(small, tmp_path):
    path = tmp_path / "spoilt.h5"
    shutil.copy(small, path)
    with h5py.File(path, "r+") as file:
        keys = [(name, key) for name, dataset in datasets(file) for key in dataset.attrs]
        assert len(keys) > 200
        before = file.attrs[CONTENT_DIGEST]
        for name, key in keys:
            changed(file[name], key)
            after = content_digest(file)
            assert after != before, (name, key)
            before = after


def test_damage_of_the_issue_is_found_in_rows_that_are_not_sampled(damaged):
    """A depth off by 4.9e-4, and the ids of two pixels swapped."""

    def swapped_ids(file):
        ids = file["object_id"][5]
        a, b = np.argwhere(ids == 0)[0], np.argwhere(ids > 0)[0]
        ids[tuple(a)], ids[tuple(b)] = ids[tuple(b)], ids[tuple(a)]
        file["object_id"][5] = ids

    def off(file):
        file["depth"][5, 3, 3] += np.float32(4.9e-4)

    for edit, name in ((off, "depth"), (swapped_ids, "object_id")):
        assert failures(damaged(edit))["content"].startswith(f"{name}: ")


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("format_version", "2.x"),
        ("writer", "someone"),
        ("variant", "opengl"),
        ("conventions", "y down"),
        ("compression", "lzf"),
        ("creation_command", 3),
        ("mitsuba_version", np.arange(3)),
        ("truth_digest", "0" * 64),
    ],
)
def test_attributes_must_be_true_even_when_sealed_again(spoilt, name, value):
    def edit(file):
        file.attrs[name] = value
        seal(file)

    failed = spoilt(edit)
    [[check, detail]] = failed.items()
    assert check == ("content" if name == "truth_digest" else "layout")
    assert name in detail


def downgraded(version):
    """The file as an older format has it: without digests, names of axes and, in 2.0, versions."""

    def edit(file):
        for name, dataset in datasets(file):
            for key in (SHA256, "DIMENSION_LIST", "DIMENSION_LABELS"):
                dataset.attrs.pop(key, None)
            if dataset.is_scale:
                del file[name]
        for key in [CONTENT_DIGEST, "truth_digest"]:
            del file.attrs[key]
        if version == "2.0":
            for key in [key for key in file.attrs if key.endswith("_version")]:
                del file.attrs[key]
        file.attrs["format_version"] = version

    return edit


@pytest.mark.parametrize("version", ["2.0", "2.1"])
def test_older_formats_still_verify_and_say_what_is_missing(small, tmp_path, version):
    path = tmp_path / "old.h5"
    shutil.copy(small, path)
    with h5py.File(path, "r+") as file:
        downgraded(version)(file)
    checks = {check.name: check for check in verify_file(path, 2)}
    assert all(check.ok for check in checks.values()), checks
    unchecked = {check.name for check in checks.values() if "not checked" in check.detail}
    assert unchecked == {"content", "drawn again from the seed", "rendered again"}


def test_a_new_format_without_digests_fails(spoilt):
    assert "content" in spoilt(gone(CONTENT_DIGEST))


@pytest.mark.parametrize(
    "edit",
    [
        edit_scene(2, lambda scene: scene.update(index=10**30)),
        put("object_id", (2, 5, 5), 127),
        put("object_id", (2, 5, 5), -128),
        put("scene_index", 2, 2**63 - 1),
        attribute("variant", h5py.Empty("S1")),
        put("camera/world_from_camera", 2, 1e308),
    ],
)
def test_impossible_values_fail_checks(spoilt, edit):
    assert {"content", "description", "object_id", "fingerprint"} & spoilt(edit, 4).keys()


NUMBERS = st.sampled_from([0, -1, 1, 127, 2**31, 2**63, 10**30, 1e308, -1e308, 1e-308, 0.5])
OTHER = st.one_of(NUMBERS, st.none(), st.text(max_size=3), st.lists(NUMBERS, max_size=4))


@given(data=st.data())
@settings(
    max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
def test_no_value_ends_in_a_traceback(small, spoilt, data):
    """A value of a dataset, or of the scene's description, is another one: a check fails."""
    draw = data.draw

    def in_dataset(file):
        numeric = [name for name, x in datasets(file) if x.dtype.kind in "iuf" and x.size]
        dataset = file[draw(st.sampled_from(numeric))]
        at = tuple(draw(st.integers(0, n - 1)) for n in dataset.shape)
        if dataset.dtype.kind == "f":
            found = draw(st.floats(width=32))
        else:
            ends = np.iinfo(dataset.dtype)
            found = draw(st.sampled_from([ends.min, ends.max, -(ends.min < 0), 0, 1, 5]))
        in_dataset.same = np.array_equal(dataset[at], dataset.dtype.type(found), equal_nan=True)
        dataset[at] = found

    def in_scene(file):
        row = draw(st.integers(0, 3))
        scene = json.loads(file["scene"][row])
        place = [scene]
        while isinstance(place[-1], (dict, list)) and place[-1]:
            last = place[-1]
            keys = list(last) if isinstance(last, dict) else range(len(last))
            key = draw(st.sampled_from(keys))
            before = last[key]
            if not isinstance(before, (dict, list)) or draw(st.integers(0, 3)) == 0:
                last[key] = draw(OTHER)
                in_scene.same = last[key] == before
                break
            place.append(before)
        file["scene"][row] = json.dumps(scene, separators=(",", ":"))

    edit = draw(st.sampled_from([in_dataset, in_scene]))
    edit.same = True
    failed = spoilt(edit, 4)
    assert failed or edit.same
