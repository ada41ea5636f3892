"""Files that are no rooms files, given to every command that reads: one line, exit code 2."""

import shutil
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
from h5_edits import attribute, damaged_chunk, gone, grouped, replaced

READERS = {
    "info": (),
    "preview": ("--out", "sheet.png"),
    "verify": ("--items", "2"),
    "export": ("--items", "0", "--format", "exr"),
}
ALL = pytest.mark.parametrize("command", READERS)


def ask(refuses, command, path, *words):
    """Run a reading command; the line must name the file first, and only once."""
    line = refuses(command, path, *READERS[command], words=(Path(path).name, *words))
    assert line.startswith(f"Error: {path}: "), "which file, first of all"
    assert line.count(str(path)) == 1
    return line


@ALL
def test_missing_file(refuses, tmp_path, command):
    ask(refuses, command, tmp_path / "none.h5", "no such file")


@ALL
def test_folder(refuses, tmp_path, command):
    (tmp_path / "x.h5").mkdir()
    ask(refuses, command, tmp_path / "x.h5", "is a folder")


@ALL
@pytest.mark.parametrize("content", [b"", b"hello\n" * 50, b"\x89HDF\r\n\x1a\n" + bytes(500)])
def test_no_hdf5(refuses, tmp_path, command, content):
    (tmp_path / "x.h5").write_bytes(content)
    line = ask(refuses, command, tmp_path / "x.h5", "not a readable HDF5 file")
    assert "errno" not in line


@ALL
@pytest.mark.parametrize("part", [0.0001, 0.01, 0.3, 0.5, 0.9, -1])
def test_truncated(refuses, tmp_path, command, rooms_path, part):
    data = rooms_path.read_bytes()
    (tmp_path / "x.h5").write_bytes(data[: int(len(data) * part) if part > 0 else part])
    ask(refuses, command, tmp_path / "x.h5", "HDF5")


def emptied(file):
    """No rows at all, consistently."""
    names = []
    file.visititems(lambda name, item: names.append(name) if hasattr(item, "dtype") else None)
    for name in names:
        shape, dtype = (0, *file[name].shape[1:]), file[name].dtype
        del file[name]
        file.create_dataset(name, shape, dtype)
    file.attrs["count"] = 0


FOREIGN = {
    "no attributes": (lambda file: [file.attrs.pop(k) for k in list(file.attrs)], "format"),
    "other format": (attribute("format", "other"), "'other'", "pix2shape-bench/rooms"),
    "format is a number": (attribute("format", 7), "7", "pix2shape-bench/rooms"),
    "format is an array": (attribute("format", np.arange(3)), "pix2shape-bench/rooms"),
    "newer": (attribute("format_version", "3.0"), "version 3.0", "reads 2.x"),
    "no version": (gone("format_version"), "version"),
    "version is a number": (attribute("format_version", 10.5), "version 10.5"),
    "no spec": (gone("spec"), "'spec' is missing"),
    "no fingerprint": (gone("fingerprint"), "'fingerprint' is missing"),
    "no writer": (gone("writer"), "'writer' is missing"),
    "spec is garbage": (attribute("spec", "garbage"), "spec"),
    "spec is bytes": (attribute("spec", np.void(b"\xff\xfe")), "spec"),
    "spec is a list": (attribute("spec", "[]"), "spec", "found list"),
    "spec is deep": (attribute("spec", "[" * 9000), "spec"),
    "spec of the future": (attribute("spec", '{"fog":1}'), "spec", "fog"),
    "spec with a bad value": (attribute("spec", '{"spp":0}'), "spec", "spp: found 0"),
    "spec with a string": (attribute("spec", '{"height":"32"}'), "spec"),
    "spec with a float": (
        attribute("spec", '{"height":32.0,"width":32.0,"min_visible_pixels":3}'),
        "spec",
    ),
    "spec with a scalar": (attribute("spec", '{"objects":3}'), "spec"),
    "spec of another size": (attribute("spec", "{}"), "image", "(8, 32, 32, 3)", "128"),
    "count": (attribute("count", 99), "8 rows", "99"),
    "no count": (gone("count"), "count"),
    "no rows": (emptied, "0"),
    "no image": (gone("image"), "'image' is missing"),
    "no depth": (gone("depth"), "'depth' is missing"),
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


@ALL
@pytest.mark.parametrize("kind", FOREIGN)
def test_foreign_hdf5(refuses, damaged, command, kind):
    edit, *words = FOREIGN[kind]
    ask(refuses, command, damaged(edit), *words)


def test_plain_hdf5_of_someone_else(refuses, tmp_path):
    with h5py.File(tmp_path / "x.h5", "w") as file:
        file["data"] = np.arange(5)
    for command in READERS:
        ask(refuses, command, tmp_path / "x.h5", "not a rooms file", "pix2shape-bench/rooms")


@pytest.mark.parametrize("name", ["image", "depth", "normal", "object_id"])
@pytest.mark.parametrize("command", ["info", "preview", "export"])
def test_a_damaged_chunk(refuses, damaged, command, name):
    ask(refuses, command, damaged(damaged_chunk(name, 0)), name, "row 0")


@pytest.mark.parametrize("text", ["{", "null", b"\xff\xfe", '{"index":0}', "[" * 9000])
@pytest.mark.parametrize("command", ["info", "preview", "export"])
def test_a_damaged_description(refuses, damaged, command, text):
    def edit(file):
        file["scene"][0] = text

    ask(refuses, command, damaged(edit), "scene", "row 0")


def test_in_a_process_of_its_own(tmp_path, rooms_path, check_refusal):
    """As a shell sees it: nothing of HDF5's own errors, nothing at exit."""
    data = rooms_path.read_bytes()
    (tmp_path / "x.h5").write_bytes(data[: len(data) // 2])
    shutil.copy(rooms_path, tmp_path / "y.h5")
    with h5py.File(tmp_path / "y.h5", "r+") as file:
        file["depth"].id.write_direct_chunk((0, 0, 0), b"\x55" * 100)
    for command in (["verify", "x.h5"], ["export", "y.h5", "--items", "0", "--format", "ply"]):
        done = subprocess.run(
            [sys.executable, "-c", "import cli; cli.scenegen()", *command],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=False,
        )
        check_refusal(done.returncode, done.stdout, done.stderr, (command[1],))
