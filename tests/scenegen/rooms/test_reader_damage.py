"""Whatever is wrong with a file, opening or reading it says which file, what and where."""

import h5py
import numpy as np
import pytest
from h5_edits import attribute, damaged_chunk, gone, grouped, replaced

from scenegen import open_rooms
from scenegen.common.errors import FileFormatError


def emptied(file):
    """No rows at all, consistently."""
    names = []
    file.visititems(lambda name, item: names.append(name) if hasattr(item, "dtype") else None)
    for name in names:
        shape, dtype = (0, *file[name].shape[1:]), file[name].dtype
        del file[name]
        file.create_dataset(name, shape, dtype)
    file.attrs["count"] = 0


DAMAGE = {
    "no attributes": (lambda file: [file.attrs.pop(k) for k in list(file.attrs)], "format"),
    "other format": (attribute("format", "other"), "'other'", "pix2shape-bench/rooms"),
    "format is a number": (attribute("format", 7), "'format'", "a text"),
    "format is an array": (attribute("format", np.arange(3)), "'format'", "a text"),
    "newer": (attribute("format_version", "3.0"), "3.0", "2."),
    "no version": (gone("format_version"), "version"),
    "version is a number": (attribute("format_version", 10.5), "'format_version'"),
    "no spec": (gone("spec"), "'spec'"),
    "no fingerprint": (gone("fingerprint"), "'fingerprint'"),
    "fingerprint is a list": (attribute("fingerprint", ["a", "b"]), "'fingerprint'", "(2,)"),
    "fingerprint is empty": (attribute("fingerprint", h5py.Empty("S1")), "'fingerprint'"),
    "writer is long": (attribute("writer", "x" * 2000), "'writer'", "1,000"),
    "no writer": (gone("writer"), "'writer'"),
    "spec is garbage": (attribute("spec", "garbage"), "spec"),
    "spec is bytes": (attribute("spec", np.void(b"\xff\xfe")), "spec"),
    "spec is a list": (attribute("spec", "[]"), "spec", "[]"),
    "spec is deep": (attribute("spec", "[" * 9000), "spec"),
    "spec of the future": (attribute("spec", '{"fog":1}'), "spec", "fog"),
    "spec with a bad value": (attribute("spec", '{"spp":0}'), "spec", "spp: found 0"),
    "spec of another size": (attribute("spec", "{}"), "image", "(8, 32, 32, 3)", "128"),
    "count": (attribute("count", 99), "8 rows", "99"),
    "no count": (gone("count"), "count"),
    "no rows": (emptied, "0"),
    "no image": (gone("image"), "'image' is missing"),
    "no lights": (gone("light"), "'light/count' is missing"),
    "no scene": (gone("scene"), "'scene' is missing"),
    "depth is a group": (grouped("depth"), "depth"),
    "image is a group": (grouped("image"), "image"),
    "image is one number": (replaced("image", lambda v: 3), "image"),
    "wrong type": (replaced("depth", lambda v: v.astype("f8")), "float64", "expected float32"),
    "wrong shape": (replaced("normal", lambda v: v[..., :2]), "2)", "expected (8, 32, 32, 3)"),
    "rows missing": (replaced("normal", lambda v: v[:5]), "(5, 32", "expected (8, 32, 32, 3)"),
    "text is numbers": (replaced("scene", lambda v: np.arange(8)), "scene", "expected strings"),
    "text is floats": (replaced("scene_index", lambda v: v / 2), "float64", "expected int64"),
}


def refused(path, *words):
    with pytest.raises(FileFormatError) as caught, open_rooms(path) as rooms:
        rooms[0]
    assert caught.value.where.startswith(str(path))
    text = str(caught.value)
    assert [word for word in words if word not in text] == [], text
    assert text.count(str(path)) == 1
    assert "errno" not in text


@pytest.mark.parametrize("kind", DAMAGE)
def test_foreign_hdf5(damaged, kind):
    edit, *words = DAMAGE[kind]
    refused(damaged(edit), *words)


@pytest.mark.parametrize("part", [0, 0.0001, 0.01, 0.3, 0.5, 0.9, -1])
def test_truncated(tmp_path, rooms_path, part):
    """A file that was cut is not kept open either: it can be replaced and read."""
    data, path = rooms_path.read_bytes(), tmp_path / "x.h5"
    path.write_bytes(data[: int(len(data) * part) if part >= 0 else part])
    refused(path, "HDF5")
    path.write_bytes(data)
    with open_rooms(path) as rooms:
        assert len(rooms) == 8


def test_plain_hdf5_of_someone_else(tmp_path):
    with h5py.File(tmp_path / "x.h5", "w") as file:
        file["data"] = np.arange(5)
    refused(tmp_path / "x.h5", "not a rooms file", "pix2shape-bench/rooms")


@pytest.mark.parametrize("name", ["image", "depth", "normal", "object_id"])
def test_a_damaged_chunk(damaged, name):
    refused(damaged(damaged_chunk(name, 0)), name, "row 0")


@pytest.mark.parametrize("text", ["{", "null", b"\xff\xfe", '{"index":0}', "[" * 9000])
def test_a_damaged_description(damaged, text):
    def edit(file):
        file["scene"][0] = text

    refused(damaged(edit), "scene", "row 0")
