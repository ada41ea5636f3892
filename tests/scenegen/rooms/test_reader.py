"""What a file of rooms holds, read with plain h5py, by hand, and with the reading API."""

import dataclasses
import hashlib
import importlib.metadata
import json

import h5py
import numpy as np

from scenegen.description.names import SHAPE_NAMES
from scenegen.description.specs import DatasetSpec
from scenegen.files.content import datasets
from scenegen.layout import FIELDS
from scenegen.rendering.backend import VERSION_ATTRIBUTES, versions
from scenegen.rooms.preview import srgb_bytes
from scenegen.rooms.reader import RoomsFile, radiance_of

# The layout as promised, written out: name, row, type, unit. K = 3 objects, L = 3 lights here.
LAYOUT = [
    ("image", (32, 32, 3), "uint8", "linear radiance, times `scale`"),
    ("depth", (32, 32), "float32", "scene unit"),
    ("normal", (32, 32, 3), "float32", "1"),
    ("object_id", (32, 32), "int8", "1"),
    ("scene_index", (), "int64", "1"),
    ("view_index", (), "int32", "1"),
    ("view_angle_degrees", (), "float64", "degree"),
    ("camera/world_from_camera", (4, 4), "float64", "scene unit"),
    ("camera/fov_y_degrees", (), "float64", "degree"),
    ("light/count", (), "int32", "1"),
    ("light/position", (3, 3), "float64", "scene unit"),
    ("light/color", (3, 3), "float64", "radiance"),
    ("light/ambient", (3,), "float64", "radiance"),
    ("light/attenuation", (2,), "float64", "1 / scene unit, 1 / scene unit squared"),
    ("material/reflectance", (4, 3), "float64", "1"),
    ("material/specular", (4,), "float64", "1"),
    ("material/shininess", (4,), "float64", "1"),
    ("object/count", (), "int32", "1"),
    ("object/shape", (3,), "int16", "1"),
    ("object/model", (3,), "|S", "-"),
    ("object/world_from_object", (3, 4, 4), "float64", "scene unit"),
    ("object/scale", (3,), "float64", "scene unit"),
    ("object/visible_pixels", (3,), "int32", "pixel"),
    ("scene", (), "|S", "-"),
]


AXES = {
    "image": ["row", "y", "x", "channel"],
    "normal": ["row", "y", "x", "xyz"],
    "object_id": ["row", "y", "x"],
    "scene": ["row"],
    "camera/world_from_camera": ["row", "matrix_row", "matrix_column"],
    "light/color": ["row", "light_slot", "channel"],
    "light/attenuation": ["row", "coefficient"],
    "material/reflectance": ["row", "material_slot", "channel"],
    "object/model": ["row", "object_slot"],
}


def test_every_dataset_and_its_attributes(rooms_path):
    with h5py.File(rooms_path) as file:
        found = {name: item for name, item in datasets(file) if not item.is_scale}
        assert sorted(found) == sorted(name for name, *_ in LAYOUT)
        for name, row, dtype, unit in LAYOUT:
            dataset = found[name]
            kind = str(dataset.dtype).rstrip("0123456789") if dtype == "|S" else str(dataset.dtype)
            assert (name, dataset.shape, kind) == (name, (8, *row), dtype)
            if dtype == "|S":  # the length of the longest one, which PyTables can read
                texts = dataset[()].reshape(-1).tolist()
                assert dataset.dtype.itemsize == max(map(len, texts))
                assert h5py.check_string_dtype(dataset.dtype).length == dataset.dtype.itemsize
            assert dataset.attrs["unit"] == unit
            labels = [axis.label for axis in dataset.dims]
            assert dataset.attrs["shape"] == f"({', '.join(labels)})"
            assert len(dataset.attrs["frame"]) > 0
            assert len(dataset.attrs["meaning"]) > 0
            per_image = (1, *row) if len(row) >= 2 and row[0] == 32 else dataset.chunks
            assert dataset.chunks == per_image, f"{name}: one chunk to an image"
        assert file["image"].attrs["scale"] == 1 / 255
        assert list(file["object/shape"].attrs["names"]) == list(SHAPE_NAMES)
        assert {name: [axis.label for axis in found[name].dims] for name in AXES} == AXES
        for name, dataset in found.items():
            for axis, length in zip(dataset.dims, dataset.shape, strict=True):
                assert file[axis.label] == axis[0], f"{name}: {axis.label}"
                np.testing.assert_array_equal(axis[0][:], np.arange(length))
    assert [field.name for field in FIELDS] == [name for name, *_ in LAYOUT]


def test_root_attributes(rooms_path):
    with h5py.File(rooms_path) as file:
        root = dict(file.attrs)
    assert root["format"] == "pix2shape-bench/rooms"
    assert root["format_version"] == "1.0"
    assert root["writer"].startswith("pix2shape-bench ")
    assert root["creation_command"] == "tests"
    assert {name: root[name] for name in VERSION_ATTRIBUTES} == versions()
    assert root["mitsuba_version"] == importlib.metadata.version("mitsuba")
    spec = json.loads(root["spec"])
    assert (spec["height"], spec["width"], spec["seed"]) == (32, 32, 3)
    later = {f.name for f in dataclasses.fields(DatasetSpec) if f.metadata["later"]}
    assert set(spec) == {f.name for f in dataclasses.fields(DatasetSpec)} - later


def test_the_fingerprint_is_that_of_spec_and_scenes(rooms_path):
    """SHA-256 over that of the stored spec and that of all scenes, computed without the library."""
    with h5py.File(rooms_path) as file:
        request = hashlib.sha256(file.attrs["spec"].encode()).hexdigest()
        rows = [hashlib.sha256(scene + b"\0").digest() for scene in file["scene"][:]]
        lines = f"request {request}\nscene {hashlib.sha256(b''.join(rows)).hexdigest()}\n"
        assert file.attrs["fingerprint"] == hashlib.sha256(lines.encode()).hexdigest()


def test_every_compression_gives_equal_contents(rooms_path, make_rooms, tmp_path):
    sizes = [rooms_path.stat().st_size]
    for compression in ("lzf", "none"):
        path = make_rooms(tmp_path / compression, 8, {"compression": compression})
        sizes.append(path.stat().st_size)
        with h5py.File(rooms_path) as a, h5py.File(path) as b:
            assert b["depth"].compression == (None if compression == "none" else compression)
            for name, *_ in LAYOUT:
                np.testing.assert_array_equal(a[name][:], b[name][:], err_msg=name)
            assert a.attrs["fingerprint"] == b.attrs["fingerprint"]
    assert sizes[0] < sizes[1] < sizes[2]


def test_radiance_of_developed_pictures_is_what_they_show(interior_path, rooms_path):
    for path in (interior_path, rooms_path):
        with RoomsFile(path) as rooms:
            np.testing.assert_array_equal(radiance_of(rooms, 0), rooms[0].radiance)
    with RoomsFile(interior_path) as rooms:
        shown = srgb_bytes(radiance_of(rooms, 0))
        np.testing.assert_array_equal(shown, rooms[0].image)
