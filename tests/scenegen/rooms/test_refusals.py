"""Everything that can be wrong with a file of rooms, and what the reader, commands and verify say.

The rules of `row_rules` have a table of their own in `test_verify.py`.
"""

import h5py
import numpy as np
import pytest
from h5_edits import attribute, damaged_chunk, gone, grouped, linked, put, replaced
from root_edits import ROOT

from scenegen import open_rooms
from scenegen.common.errors import FileFormatError

READERS = {
    "info": (),
    "preview": ("--out", "sheet.png"),
    "verify": ("--items", "2"),
    "export": ("--items", "5", "--format", "exr"),
    "card": ("--creator", "A", "--out", "card"),
}


def emptied(file):
    """No rows at all, consistently."""
    names = []
    file.visititems(lambda name, item: names.append(name) if hasattr(item, "dtype") else None)
    for name in names:
        shape, dtype = (0, *file[name].shape[1:]), file[name].dtype
        del file[name]
        file.create_dataset(name, shape, dtype)


# Edits of a good file, and words of the error.
REFUSED = {
    **ROOT,
    "no attributes": (lambda file: [file.attrs.pop(k) for k in list(file.attrs)], "'format'"),
    "fingerprint is empty": (attribute("fingerprint", h5py.Empty("S1")), "'fingerprint'"),
    "other variant": (attribute("variant", "opengl"), "'variant'"),
    "other conventions": (attribute("conventions", "y down"), "'conventions'"),
    "spec is bytes": (attribute("spec", np.void(b"\xff\xfe")), "'spec'"),
    "spec with a bad value": (attribute("spec", '{"spp":0}'), "'spec'", "spp"),
    "spec of another size": (attribute("spec", "{}"), "image", "(8, 32, 32, 3)", "128"),
    "no rows": (emptied, "image"),
    "no image": (gone("image"), "image"),
    "another scale": (lambda f: f["image"].attrs.update(scale=1.0), "image", "'scale'"),
    "fewer shapes": (lambda f: f["object/shape"].attrs.update(names=["box"]), "'names'"),
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
    "a dead link": (linked("depth", h5py.SoftLink("/nothing")), "depth", "a link"),
}


def refused(path, *words, row=0):
    """Check that the reader refuses a file, or one of its rows, in one line."""
    with pytest.raises(FileFormatError) as caught, open_rooms(path) as rooms:
        rooms[row]
    assert caught.value.where.startswith(str(path))
    text = str(caught.value)
    assert [word for word in words if word not in text] == [], text
    assert text.count(str(path)) == 1
    assert "errno" not in text


def ask(refuses, command, path, *words):
    """Run a command; its line must name the file first, and only once."""
    line = refuses(command, path, *READERS[command], words=(path.name, *words))
    assert line.startswith(f"Error: {path}: "), "which file, first of all"
    assert line.count(str(path)) == 1


@pytest.mark.parametrize("kind", REFUSED)
def test_what_is_no_file_of_rooms_is_refused_by_all(damaged, refuses, kind):
    edit, *words = REFUSED[kind]
    path = damaged(edit)
    refused(path, *words)
    if kind in ROOT:  # commands open files by the same reader
        ask(refuses, "info", path, *words)


@pytest.mark.parametrize("command", READERS)
def test_each_command_refuses_what_is_no_hdf5(refuses, tmp_path, rooms_path, command, damaged):
    ask(refuses, command, tmp_path / "none.h5", "no such file")
    (tmp_path / "folder.h5").mkdir()
    ask(refuses, command, tmp_path / "folder.h5", "is a folder")
    data, path = rooms_path.read_bytes(), tmp_path / "x.h5"
    for content in (b"", b"hello\n" * 50, b"\x89HDF\r\n\x1a\n" + bytes(500), data[:-1]):
        path.write_bytes(content)
        refused(path, "HDF5")
        ask(refuses, command, path, "HDF5")
    ask(refuses, command, damaged(attribute("format", "other")), "pix2shape-bench/rooms")


@pytest.mark.parametrize("part", [0.0001, 0.01, 0.3, 0.5, 0.9])
def test_a_file_that_was_cut_is_not_kept_open(tmp_path, rooms_path, part):
    data, path = rooms_path.read_bytes(), tmp_path / "x.h5"
    path.write_bytes(data[: int(len(data) * part)])
    refused(path, "HDF5")
    path.write_bytes(data)
    with open_rooms(path) as rooms:
        assert len(rooms) == 8


# Edits of row 5: words of the error of whoever reads it, and a check of verify that fails.
DAMAGED_ROWS = {
    **{f"chunk of {name}": (damaged_chunk(name, 5), name, name) for name in ("image", "depth")},
    **{
        f"scene {text[:9]!r}": (put("scene", 5, text), "scene", "description")
        for text in ("{", "null", b"\xff\xfe", '{"index":5}', "[" * 9000)
    },
}


@pytest.mark.parametrize("kind", DAMAGED_ROWS)
def test_a_damaged_row_spoils_itself_only(damaged, refuses, verdict, kind):
    edit, word, check = DAMAGED_ROWS[kind]
    path = damaged(edit)
    refused(path, word, "row 5", row=5)
    with open_rooms(path) as rooms:
        assert (rooms[4].index, rooms[6].index) == (4, 6)
    for command in ("info", "preview", "export"):
        ask(refuses, command, path, word, "row 5")
    code, checks, output = verdict(path, "--items", "2")
    assert (code, checks[check]) == (1, "FAIL")
    assert "row 5" in output
