"""Exported rows, read by the loaders that people use: nothing is lost, and nothing half done."""

import json
import tarfile

import numpy as np
import pytest
from PIL import Image

from scenegen import open_rooms
from scenegen.common.errors import FileFormatError, SpecError
from scenegen.layout import FIELDS
from scenegen.rooms.export.formats import DATA_FORMATS
from scenegen.sharing.export import ABOUT, write_export
from scenegen.sharing.rooms import ROOMS
from tests.support.loaders import VALUES, check_srgb


@pytest.fixture(params=["8 bits", "floats"])
def path(request, holey_set, float_path):
    return holey_set if request.param == "8 bits" else float_path


def export_rows(path, form, folder, rows=None, **how):
    with open_rooms(path) as rooms:
        return write_export(rooms, ROOMS, form, folder, rows, **how)


def as_stored(value, stored):
    """A value of a loader in the type that the file of rooms has."""
    if isinstance(stored, bytes):
        return value.encode()
    if np.asarray(stored).dtype.kind in "OS":
        return [part.encode() for part in value]
    return np.asarray(value).astype(stored.dtype)


def check_rows(found, path, rows, column):
    """Compare each value of each row; `column` gives that of a dataset from a loaded row."""
    assert len(found) == len(rows)
    with open_rooms(path) as rooms:
        for place, row in enumerate(rows):
            values = found[place]
            for field in FIELDS:
                stored = rooms.read(field.name, row)
                value = column(values, field.name.replace("/", "_"))
                np.testing.assert_array_equal(as_stored(value, stored), stored, field.name)
        if path.name == "set.h5":
            assert np.isnan(rooms.read("depth", 0)).any(), "or NaN is not tested"


@pytest.mark.parametrize("form", DATA_FORMATS)
def test_every_value_in_datasets(form, path, load, tmp_path):
    """From a list of files, and from their folder."""
    made = export_rows(path, form, tmp_path / "out", encoding="linear", rows_per_file=4)
    loaded = load(form, data_files=[str(p) for p in made if p.name != ABOUT])
    check_rows(loaded, path, range(len(loaded)), VALUES[form])
    assert load(str(tmp_path / "out")).num_rows == len(loaded)
    if form == "webdataset":
        assert loaded["__key__"] == [f"{row:09d}" for row in range(len(loaded))]
        return
    assert loaded["row"] == list(range(len(loaded)))
    assert loaded.features["depth"].shape == loaded.with_format("numpy")[0]["depth"].shape
    picture = type(loaded.features["image"]).__name__
    assert picture == ("Image" if path.name == "set.h5" else "Array3D")


@pytest.mark.parametrize("form", DATA_FORMATS)
def test_pictures_are_srgb_and_decode_to_the_stored_radiance(form, holey_set, load, tmp_path):
    made = export_rows(holey_set, form, tmp_path / "out", rows_per_file=99)
    about = json.loads((tmp_path / "out" / ABOUT).read_text())["columns"]["image"]
    assert (about["encoding"], about["unit"], about["scale"]) == ("srgb", "sRGB", 1 / 255)
    loaded = load(form, data_files=[str(made[0])])
    with open_rooms(holey_set) as rooms:
        for room, row in zip(rooms, loaded, strict=True):
            codes = np.asarray(VALUES[form](row, "image")).astype(float)
            check_srgb(codes, room.radiance)
            assert np.abs(codes - room.image).max() > 40, "a curve that does nothing"


@pytest.mark.parametrize("encoding", ["srgb", "linear"])
def test_developed_pictures_are_encoded_once(interior_path, tmp_path, encoding):
    export_rows(interior_path, "webdataset", tmp_path / "out", encoding=encoding)
    about = json.loads((tmp_path / "out" / ABOUT).read_text())["columns"]["image"]
    assert about["encoding"] == encoding
    with tarfile.open(tmp_path / "out" / "x-00000-of-00001.tar") as archive:
        (name,) = (name for name in archive.getnames() if ".image." in name)
        codes = np.asarray(Image.open(archive.extractfile(name))).astype(float)
    with open_rooms(interior_path) as rooms:
        expected = rooms[0].image if encoding == "srgb" else 255 * rooms[0].radiance
    np.testing.assert_allclose(codes, expected, rtol=0, atol=0.501 if encoding == "linear" else 0)


@pytest.mark.parametrize("form", DATA_FORMATS)
def test_the_same_bytes_again_and_an_older_folder_is_replaced(form, holey_set, tmp_path):
    def contents():
        return {p.name: p.read_bytes() for p in (tmp_path / "out").iterdir()}

    export_rows(holey_set, form, tmp_path / "out", rows_per_file=2)
    many = contents()
    made = export_rows(holey_set, form, tmp_path / "out", rows_per_file=4, overwrite=True)
    assert set(contents()) == {p.name for p in made}, "files of the older run are gone"
    export_rows(holey_set, form, tmp_path / "out", rows_per_file=2, overwrite=True)
    assert contents() == many
    (tmp_path / "out" / "mine.txt").write_text("mine")
    with pytest.raises(FileExistsError):
        export_rows(holey_set, form, tmp_path / "out", overwrite=True)


def shortened(file):
    file["depth"].id.write_direct_chunk((5, 0, 0), b"no deflate stream", 0)


def no_text(file):
    file["object/model"][5, 0] = b"\xff"


@pytest.mark.parametrize("form", DATA_FORMATS)
@pytest.mark.parametrize(("name", "damage"), [("depth", shortened), ("object/model", no_text)])
def test_a_damaged_row_leaves_nothing(name, damage, form, damaged, tmp_path):
    path = damaged(damage)
    with pytest.raises(FileFormatError) as error:
        export_rows(path, form, tmp_path / "out", rows_per_file=2)
    assert f"{name}, row 5" in error.value.where
    assert [p.name for p in tmp_path.iterdir()] == [path.name]
    export_rows(path, form, tmp_path / "out", rows=[0, 7])


@pytest.mark.parametrize(
    ("how", "where"),
    [
        ({"rows": [0, 0]}, "items"),
        ({"rows": [99]}, "items"),
        ({"rows": []}, "items"),
        ({"rows_per_file": 0}, "rows per file"),
        ({"encoding": "log"}, "encoding"),
    ],
)
def test_refused(how, where, rooms_path, tmp_path):
    with pytest.raises(SpecError) as error:
        export_rows(rooms_path, "parquet", tmp_path / "out", **how)
    assert error.value.where == where
    assert list(tmp_path.iterdir()) == []
