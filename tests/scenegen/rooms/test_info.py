"""`scenegen info` says what is in a file, and says it truly."""

import json
import re

import h5py
import numpy as np
import pytest

from scenegen import open_rooms
from scenegen.rooms.info import describe


def value(text, name):
    """Return what the first line says that starts with a name."""
    return re.findall(rf"^\W*{re.escape(name)} {{2,}}(.+)$", text, re.MULTILINE)[0].strip()


def test_header_and_spec(float_path):
    text = describe(float_path)
    with h5py.File(float_path) as file:
        root = dict(file.attrs)
    size = float_path.stat().st_size / 1e6
    assert text.splitlines()[0] == f"{float_path}: 5 images of 48x40, {size:.1f} MB"
    assert value(text, "fingerprint") == root["fingerprint"]
    assert value(text, "truth digest") == root["truth_digest"]
    assert value(text, "content digest") == root["content_digest"]
    assert value(text, "command") == "tests"
    assert value(text, "format") == "pix2shape-bench/rooms 1.0"
    assert value(text, "written by") == f"{root['writer']}, {root['variant']}"
    assert "y up" in value(text, "conventions")
    for name, setting in json.loads(root["spec"]).items():
        shown = ", ".join(map(str, setting)) if isinstance(setting, list) else str(setting)
        assert value(text, name) == shown
    changed = set(re.findall(r"^ +\* (\w+) ", text, re.MULTILINE))
    assert changed == {"seed", "height", "width", "image_dtype", "min_visible_pixels"}


def test_ranges_are_those_of_the_file(float_path):
    """Few rows, so that all of them are read."""
    text = describe(float_path)
    with h5py.File(float_path) as file:
        expected = {
            "radiance": file["image"][:],
            "depth": file["depth"][:],
            "n_z": file["normal"][..., 2],
            "object_id": file["object_id"][:],
        }
    for name, array in expected.items():
        low, high = map(float, re.findall(rf"^ +{name} +(\S+) to (\S+)$", text, re.MULTILINE)[0])
        assert (low, high) == pytest.approx((array.min(), array.max()), rel=1e-3, abs=1e-3)
    with open_rooms(float_path) as rooms:
        shapes = [item.shape for room in rooms for item in room.scene.objects]
    for name in set(shapes):
        assert f"{name} {shapes.count(name)}" in text
    assert "over 5 rows" in text


def test_every_dataset_with_unit_and_size(rooms_path):
    table = describe(rooms_path).partition(" dataset ")[2]
    with h5py.File(rooms_path) as file:
        for name in ("image", "depth", "normal", "object_id", "light/color"):
            line = value(table, name)
            stored = file[name].id.get_storage_size()
            assert f"{stored / 1e3:.1f} kB" in line or f"{stored / 1e6:.1f} MB" in line
            assert file[name].attrs["unit"][:20] in line
            assert f" {file[name].dtype} " in line
            assert line.endswith(f" {file[name].nbytes / stored:.1f}")


def test_sizes_of_text_count_the_text(rooms_path):
    """Not only the pointers to it."""
    table = describe(rooms_path).partition(" dataset ")[2]
    with h5py.File(rooms_path) as file:
        lines = file["scene"].asstr()[:]
    [(size, unit)] = re.findall(r"([\d.]+) (kB|MB)", value(table, "scene"))
    assert float(size) * {"kB": 1e3, "MB": 1e6}[unit] > sum(map(len, lines)) / 2


def test_unknown_pixels_do_not_spoil_the_ranges(damaged):
    def edit(file):
        file["depth"][0, :4] = np.nan
        file["object_id"][0, :4] = -1

    text = describe(damaged(edit))
    assert "nan" not in text
    assert re.search(r"object_id +-1 to", text)


def test_the_command_prints_it(run, rooms_path):
    result = run("info", rooms_path)
    assert result.exit_code == 0
    assert result.output == describe(rooms_path) + "\n"


@pytest.mark.parametrize(
    ("command", "line"),
    [("a\x1b[31m\nb", r"a\x1b[31m\nb"), ("x" * 60_000, "x" * 997 + "...")],
    ids=["controls", "long"],
)
def test_a_command_is_shown_on_one_short_line(damaged, command, line):
    text = describe(damaged(lambda file: file.attrs.update(creation_command=command)))
    assert value(text, "command") == line
    assert all(one.isprintable() for one in text.split("\n"))
