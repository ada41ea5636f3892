"""`scenegen verify` passes good files, and fails on each kind of damage at the right check.

Whatever a row holds, it never ends in a traceback. Files that the reader refuses are in
`test_refusals.py`.
"""

import re
import shutil

import h5py
import numpy as np
import pytest
from h5_edits import attribute, edit_scene, gone, put, swap_rows, values
from verified import checks_of

from scenegen.common.errors import FileFormatError
from scenegen.description.specs import DatasetSpec
from scenegen.files.content import datasets, seal
from scenegen.files.verify import content_check, read_all
from scenegen.rooms.reader import RoomsFile
from scenegen.rooms.verify import _within_tolerance

ROWS = {"layout", "content", "description", "depth", "normal", "object_id", "image", "fingerprint"}
ALL = ROWS | {"drawn again from the seed", "rendered again"}


def failures(path, items=0):
    return {check.name: check.detail for check in checks_of(path, items) if not check.ok}


def spoilt(source, folder, edit):
    """Copy a file to a folder, let `edit` at the copy, and return it."""
    path = shutil.copy(source, folder / "spoilt.h5")
    with h5py.File(path, "r+") as file:
        edit(file)
    return path


@pytest.fixture(scope="module")
def small(make_rooms, tmp_path_factory):
    """Two scenes of two views; no test changes the file."""
    path = tmp_path_factory.mktemp("small") / "small.h5"
    return make_rooms(path, 2, views=(0.0, 35.0), random_reflectance=True, specular=(0.1, 0.3))


@pytest.fixture(scope="module")
def three(make_rooms, tmp_path_factory):
    """Three scenes; no test changes the file."""
    return make_rooms(tmp_path_factory.mktemp("three") / "three.h5", 3)


@pytest.mark.parametrize("which", ["rooms_path", "float_path"])
def test_a_good_file_passes(verdict, request, which):
    path = request.getfixturevalue(which)
    code, checks, output = verdict(path)
    assert (code, set(checks.values()), set(checks)) == (0, {"ok"}, ALL)
    assert output.splitlines()[0] == f"{path}: verified"
    assert "bit for bit" in output


@pytest.mark.parametrize(
    "how",
    [
        {"specular": (10.0, 10.0), "shininess": (10_000.0, 10_000.0), "light_level": 100.0},
        {"fov_degrees": 70.0, "specular": (0.2, 0.6), "shininess": (2.0, 9.0)},
        {"shadows": True, "spp": 2, "specular": (0.2, 0.6)},
        {"lights": (0, 0), "specular": (0.2, 0.6)},
        {"objects": (0, 0), "lights": (0, 0)},
        {"pose": "any", "allow_cropped": True, "light_saturation": 1.0, "lights": (5, 5)},
    ],
    ids=str,
)
@pytest.mark.parametrize(
    "dtype",
    ["uint8", *(pytest.param(name, marks=pytest.mark.slow) for name in ("float16", "float32"))],
)
def test_no_honest_file_fails(how, dtype, make_rooms, tmp_path):
    rooms = {"image_dtype": dtype, "objects": (2, 3), "lights": (2, 3), **how}
    assert failures(make_rooms(tmp_path / "x.h5", 3, **rooms), 1) == {}


OTHERS = {
    "Mitsuba": {"mitsuba_version": "3.8.1"},
    "release": {"writer": "pix2shape-bench 0.0.9"},
    "variant": {"variant": "scalar_rgb"},
}


def at_edge(file):
    """One pixel of the floor beside an object shows the object."""
    ids = file["object_id"][2]
    row, column = np.argwhere((ids[:, 1:] > 0) & (ids[:, :-1] == 0))[0]
    for name in ("object_id", "depth", "normal", "image"):
        file[name][2, row, column] = file[name][2, row, column + 1]


def nudged(name, by):
    return values(name, lambda array: array + array.dtype.type(by))


@pytest.mark.parametrize("other", [None, "Mitsuba", "release", "variant"])
@pytest.mark.parametrize(
    ("edit", "alike"),
    [(nudged("depth", 5e-5), True), (at_edge, True), (put("object_id", (2, 7, 9), 3), False)],
    ids=["depth 5e-5", "one id at an edge", "one id"],
)
def test_other_versions_are_told_and_compared_within_a_tolerance(
    three, tmp_path, other, edit, alike
):
    """With the same versions a single bit counts."""
    attributes = OTHERS.get(other, {})

    def spoil(file):
        edit(file)
        file.attrs.update(attributes)

    path = spoilt(three, tmp_path, spoil)
    again = {check.name: check for check in checks_of(path, 3)}["rendered again"]
    assert again.ok == (bool(attributes) and alike), again.detail
    for name, value in attributes.items():
        assert f"{name} {value}" in again.detail


def shifted_ids(ids):
    return np.where(ids > 0, ids + 1, ids)


def swapped_ids(ids):
    """The ids of two pixels in each other's place."""
    a, b = np.argwhere(ids == 0)[0], np.argwhere(ids > 0)[0]
    ids[tuple(a)], ids[tuple(b)] = ids[tuple(b)], ids[tuple(a)]
    return ids


def other_shape(scene):
    scene["objects"][0]["shape"] = "box" if scene["objects"][0]["shape"] != "box" else "cone"


def row_2(name, change):
    """Other values in row 2 of a dataset."""
    return lambda file: file[name].__setitem__(2, change(file[name][2]))


def scene_2(change):
    return edit_scene(2, change), {"description", "fingerprint"}


PIXEL = (2, 7, 9)
# Edits of a file of three scenes, and checks that must fail. All but the last three are in row 2.
DAMAGE = {
    "depth scaled": (row_2("depth", lambda v: v * np.float32(1.001)), {"image", "rendered again"}),
    "one NaN in depth": (put("depth", PIXEL, np.nan), {"depth", "rendered again"}),
    "one infinite depth": (put("depth", PIXEL, np.inf), {"depth"}),
    "normal flipped": (row_2("normal", np.negative), {"normal", "rendered again"}),
    "normal too short": (row_2("normal", lambda v: v * np.float32(0.9999)), {"normal"}),
    "normals turned": (row_2("normal", lambda v: v[..., [1, 0, 2]]), {"image"}),
    "object_id off by one": (row_2("object_id", shifted_ids), {"object_id", "rendered again"}),
    "one object_id": (put("object_id", (2, 0, 0), -1), {"depth", "normal", "rendered again"}),
    "object_id 127": (put("object_id", (2, 0, 0), 127), {"object_id"}),
    "object_id -128": (put("object_id", (2, 0, 0), -128), {"object_id"}),
    "image changed by 2 levels": (
        row_2("image", lambda v: v + np.uint8(2)), {"image", "rendered again"},
    ),
    "camera matrix": (row_2("camera/world_from_camera", lambda v: v + 1e-6), {"description"}),
    "a camera nowhere": (put("camera/world_from_camera", 2, 1e308), {"description"}),
    "scene_index": (put("scene_index", 2, 2**63 - 1), {"description"}),
    "two images swapped": (swap_rows(0, 2, "image"), {"image", "rendered again"}),
    "two depth maps swapped": (swap_rows(0, 2, "depth"), {"image", "rendered again"}),
    "two scenes swapped": (swap_rows(0, 2, "scene"), {"description", "fingerprint"}),
    "two indices swapped": (swap_rows(0, 2, "scene_index"), {"description"}),
    "count of visible pixels": (swap_rows(0, 2, "object/visible_pixels"), {"object_id"}),
    "a view that the scene does not have": (put("view_index", 2, 1), {"description"}),
    "a view below 0": (put("view_index", 2, -1), {"description"}),
    "a view far beyond": (put("view_index", 2, 2**31 - 1), {"description"}),
    "JSON: a light moved": scene_2(lambda s: s["lights"][0].update(position=[2.0, 1.0, 1.0])),
    "JSON: another shape": scene_2(other_shape),
    "JSON: a camera that looks down": scene_2(
        lambda s: s["cameras"][0].update(position=[0.3, 2, 0.3])
    ),
    "JSON: no such shape": scene_2(lambda s: s["objects"][0].update(shape="foo")),
    "JSON: many objects": scene_2(lambda s: s.update(objects=s["objects"] * 9)),
    "JSON: a negative index": scene_2(lambda s: s.update(index=-5)),
    "JSON: a huge index": scene_2(lambda s: s.update(index=10**30)),
    "JSON: NaN": scene_2(lambda s: s["lights"][0].update(position=[float("nan")] * 3)),
    "fingerprint": (attribute("fingerprint", "0" * 64), {"fingerprint"}),
    "the spec's seed": (
        lambda file: file.attrs.update(spec=file.attrs["spec"].replace('"seed":3', '"seed":4')),
        {"fingerprint", "drawn again from the seed"},
    ),
    "all of two rows swapped": (swap_rows(0, 2), {"fingerprint"}),
}  # fmt: skip


# Of these the rows are drawn and rendered again in every run of the tests.
RENDERED = {"depth scaled", "one object_id", "a camera nowhere", "JSON: many objects",
            "JSON: NaN", "the spec's seed"}  # fmt: skip


@pytest.mark.parametrize(
    ("kind", "items"),
    [
        pytest.param(kind, items, marks=pytest.mark.slow if items and kind not in RENDERED else [])
        for kind in DAMAGE
        for items in (0, 3)
    ],
)
def test_damage_fails_at_the_right_check(three, tmp_path, kind, items):
    edit, expected = DAMAGE[kind]
    made = ALL if items else ROWS
    checks = {check.name: check for check in checks_of(spoilt(three, tmp_path, edit), items)}
    assert set(checks) == made, "the other checks are still made"
    assert {"content", *expected} & made <= {name for name in made if not checks[name].ok}
    if kind in [*DAMAGE][:-3]:
        assert re.search("row [02]", "".join(checks[name].detail for name in expected & made))


VIEWS = {"views": (0.0, 5.0, 35.0), "object_radius": (0.08, 0.15)}
DAMAGE_TO_VIEWS = {
    "another background in one view's JSON": (
        edit_scene(4, lambda s: s.update(background=[0.5, 0.0, 0.0])), {"description"},
    ),
    "a camera too many in one view's JSON": (
        edit_scene(4, lambda s: s["cameras"].append(s["cameras"][0])), {"description"},
    ),
    "a view said to be the first": (put("view_index", 4, 0), {"description"}),
    "an angle": (put("view_angle_degrees", 4, 5.5), {"description"}),
    "two views' rows swapped": (swap_rows(4, 5), {"description"}),
    "two scenes' views swapped": (swap_rows(4, 7), {"description"}),
    "two views' images swapped": (swap_rows(4, 5, "image"), {"image"}),
    "a material": (put("material/specular", 4, [0.0, 0.1, 0.1, 0.1]), {"description"}),
    "a model": (put("object/model", 4, ["box/1", "", ""]), {"description"}),
}  # fmt: skip


@pytest.fixture(scope="module")
def views_path(make_rooms, tmp_path_factory):
    """Three scenes from three sides; no test changes the file."""
    return make_rooms(tmp_path_factory.mktemp("views") / "views.h5", 3, **VIEWS)


@pytest.mark.parametrize("items", [0, pytest.param(9, marks=pytest.mark.slow)])
@pytest.mark.parametrize("kind", DAMAGE_TO_VIEWS)
def test_damage_to_one_view_is_found_without_rendering(kind, items, views_path, tmp_path):
    """Nor does rendering end in a traceback."""
    edit, expected = DAMAGE_TO_VIEWS[kind]
    assert expected <= set(failures(spoilt(views_path, tmp_path, edit), items))


@pytest.mark.parametrize("how", [{"shadows": True}, {"spp": 4}], ids=str)
@pytest.mark.parametrize("name", ["depth", "image"])
def test_shadows_and_samples_do_not_switch_the_checks_off(how, name, make_rooms, tmp_path):
    """Surfels of the room lie on its planes, and no image is darker than ambient light alone."""
    path = make_rooms(tmp_path / "x.h5", 3, **how)
    with h5py.File(path, "r+") as file:
        file[name][1] = file[name][1] * 1.01 if name == "depth" else file[name][1] // 20
    assert name in failures(path)


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
    "ids of two pixels swapped": lambda f: f["object_id"].__setitem__(
        3, swapped_ids(f["object_id"][3])
    ),
    "a depth off by 4.9e-4": put("depth", (3, 3, 3), 1.2345),
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


@pytest.mark.parametrize("every", [3, pytest.param(1, marks=pytest.mark.slow)])
def test_every_changed_bit_is_found(every, small, tmp_path):
    """Most of the root's attributes are looked at before: such a file is refused."""
    missed, refused = [], []
    for what, edit in list(edits_of(small))[::every]:
        path = spoilt(small, tmp_path, edit)
        try:
            with RoomsFile(path) as rooms:
                digests, _ = read_all(rooms, 4, lambda block, row: (), lambda rows: None)
                check = content_check("content", rooms.opened, digests)
        except FileFormatError:
            refused.append(what)
            continue
        found = "" if check.ok else check.detail
        if not found or (what.startswith("bit of ") and f"{what[7:]}: " not in found):
            missed.append(what)
    assert not missed
    assert {what.partition("@")[0] for what in refused} == {"other /", "no /"}


@pytest.mark.parametrize(
    ("name", "key", "value"),
    [
        ("/", "truth_digest", "0" * 64),
        ("depth", "unit", "metre"),
        ("normal", "frame", "world"),
        ("scene_index", "meaning", "nothing"),
        ("depth", "DIMENSION_LABELS", ["row", "x", "y"]),
    ],
)
def test_attributes_must_be_true_even_when_sealed_again(small, tmp_path, name, key, value):
    """A reader with plain h5py believes them."""

    def edit(file):
        file[name].attrs[key] = value
        seal(file)

    assert set(failures(spoilt(small, tmp_path, edit))) == {"layout"}


@pytest.mark.parametrize(
    ("how", "factor", "within"),
    [
        ({"shading": "path"}, 1.08, True),
        ({"shading": "path"}, 0.92, True),
        ({"shading": "path"}, 1.2, False),
        ({}, 1 + 5e-5, True),
        ({}, 1 + 1e-3, False),
        ({"image_dtype": "float16"}, 1 + 2.0**-11, True),
        ({"image_dtype": "float16"}, 1 + 2.0**-8, False),
    ],
)
def test_images_agree_in_their_floats_and_path_traced_ones_in_their_means(how, factor, within):
    spec = DatasetSpec(**{"image_dtype": "float32", **how})
    noise = 1.0 + np.random.default_rng(0).uniform(-0.5, 0.5, (64, 64, 3))
    noise = (noise / noise.mean() / 2).astype(spec.image_dtype)
    again = np.full_like(noise, 0.5) if how.get("shading") else noise
    stored, none = (factor * noise).astype(noise.dtype), np.zeros((64, 64), bool)
    assert _within_tolerance("image", stored, again, none, spec) == within


@pytest.mark.parametrize(
    ("name", "by", "within"),
    [
        ("depth", 5e-5, True),
        ("depth", 1e-2, False),
        ("normal", 5e-4, True),
        ("normal", 5e-3, False),
        ("image", 1, True),
        ("image", 3, False),
        ("object_id", 1, False),
        ("layers/depth", 5e-5, True),
        ("layers/depth", 1e-2, False),
        ("layers/entering", 1, False),
        ("object/amodal_mask", 1, False),
        ("object/closed", 1, False),
    ],
)
def test_tolerances_of_pixels(name, by, within):
    again, none = np.ones((64, 64)), np.zeros((64, 64), bool)
    if "/" in name:  # several images of a row, or a number for each object
        shape = {"object/closed": (5,), "object/amodal_mask": (5, 64, 64)}.get(name, (64, 64, 5))
        again = np.ones(shape)
    assert _within_tolerance(name, again + by, again, none, DatasetSpec()) == within


@pytest.mark.parametrize(("pixels", "within"), [(0, True), (2, True), (20, False)])
def test_few_pixels_of_edges_may_show_their_neighbours(pixels, within):
    """Of the columns at a step of depth, one in a thousand of all pixels."""
    again = np.where(np.arange(64) < 32, 1.0, 2.0) * np.ones((64, 1))
    edges = np.broadcast_to(abs(np.arange(64) - 31.5) < 1, (64, 64))
    stored = again.copy()
    stored[:pixels, 31] = 2.0
    assert _within_tolerance("depth", stored, again, edges, DatasetSpec()) == within
    stored[5, 9] = 2.0
    assert not _within_tolerance("depth", stored, again, edges, DatasetSpec()), "not at an edge"
