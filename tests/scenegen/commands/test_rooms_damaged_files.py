"""Files that are no files of rooms, given to every command that reads: one line, exit code 2.

All kinds of damage are tried in `tests/scenegen/rooms/test_reader_damage.py`.
"""

import subprocess
import sys
from pathlib import Path

import pytest
from h5_edits import attribute, damaged_chunk, gone, put

READERS = {
    "info": (),
    "preview": ("--out", "sheet.png"),
    "verify": ("--items", "2"),
    "export": ("--items", "0", "--format", "exr"),
    "card": ("--creator", "A", "--date", "2026-01-31", "--out", "card"),
}


def ask(refuses, command, path, *words):
    """Run a reading command; the line must name the file first, and only once."""
    line = refuses(command, path, *READERS[command], words=(Path(path).name, *words))
    assert line.startswith(f"Error: {path}: "), "which file, first of all"
    assert line.count(str(path)) == 1


@pytest.mark.parametrize("command", READERS)
def test_no_file_of_rooms(refuses, damaged, tmp_path, rooms_path, command):
    ask(refuses, command, tmp_path / "none.h5", "no such file")
    (tmp_path / "folder.h5").mkdir()
    ask(refuses, command, tmp_path / "folder.h5", "is a folder")
    data = rooms_path.read_bytes()
    for content in (
        b"",
        b"hello\n" * 50,
        b"\x89HDF\r\n\x1a\n" + bytes(500),
        data[:-1],
        data[:9999],
    ):
        (tmp_path / "x.h5").write_bytes(content)
        ask(refuses, command, tmp_path / "x.h5", "HDF5")
    ask(refuses, command, damaged(attribute("format", "other")), "pix2shape-bench/rooms")
    ask(refuses, command, damaged(gone("depth")), "'depth' is missing")


@pytest.mark.parametrize("command", ["info", "preview", "export"])
def test_a_damaged_row(refuses, damaged, command):
    ask(refuses, command, damaged(damaged_chunk("depth", 0)), "depth", "row 0")
    ask(refuses, command, damaged(put("scene", 0, b"\xff\xfe")), "scene", "row 0")


def test_in_a_process_of_its_own(tmp_path, rooms_path, check_refusal, damaged):
    """As a shell sees it: nothing of HDF5's own errors, nothing at exit."""
    path = damaged(damaged_chunk("depth", 0))
    done = subprocess.run(
        [sys.executable, "-c", "import cli; cli.scenegen()", "export", path.name,
         "--items", "0", "--format", "ply"],
        cwd=tmp_path, capture_output=True, text=True, check=False,
    )  # fmt: skip
    check_refusal(done.returncode, done.stdout, done.stderr, (path.name,))
