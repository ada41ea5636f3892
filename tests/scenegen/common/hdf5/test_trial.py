"""Files on which HDF5 itself hangs or crashes, found by changing bytes of files that it wrote."""

import shutil
import zlib
from pathlib import Path

import h5py
import numpy as np
import pytest
from click.testing import CliRunner

import cli
from scenegen.common.errors import FileFormatError
from scenegen.common.hdf5 import trial
from scenegen.common.hdf5.trial import try_file

HOSTILE = Path(__file__).parents[3] / "support" / "hostile"


@pytest.fixture
def broken(tmp_path):
    """Return a function that unpacks a file of this name."""

    def unpack(name):
        path = tmp_path / f"{name}.h5"
        path.write_bytes(zlib.decompress((HOSTILE / f"{path.name}.z").read_bytes()))
        return path

    return unpack


def test_a_file_on_which_hdf5_hangs(broken, monkeypatch):
    monkeypatch.setattr(trial, "SECONDS", 1.9)
    with pytest.raises(FileFormatError) as error:
        try_file(broken("hangs"))
    assert error.value.where.endswith("hangs.h5")
    assert "s of a processor" in error.value.found


def test_a_file_on_which_hdf5_crashes(broken):
    with pytest.raises(FileFormatError) as error:
        try_file(broken("crashes"))
    assert "signal 11" in error.value.found


def test_texts_that_take_more_memory_than_honest_files(tmp_path, monkeypatch):
    monkeypatch.setattr(trial, "MEMORY", 2**26)
    path = tmp_path / "large.h5"
    with h5py.File(path, "w") as file:
        file.attrs["spec"] = "x" * 2**26
    with pytest.raises(FileFormatError) as error:
        try_file(path)
    assert "memory" in error.value.found


def test_files_that_another_process_can_read(rooms_path, tmp_path):
    (tmp_path / "text").write_text("no HDF5")
    for path in (rooms_path, tmp_path / "text", tmp_path / "nothing", tmp_path):
        try_file(path)


@pytest.mark.tried
@pytest.mark.parametrize(
    "command",
    [
        "scenegen info hangs.h5",
        "iqtt audit split",
        "iqtt show split/iqtt-test.h5 --answers",
        "bench score a.json --truth split/iqtt-test.h5",
        "bench validate hangs.h5",
    ],
)
def test_whatever_a_command_reads_is_tried_first(command, broken, tmp_path, monkeypatch):
    """A file that is named, that lies in a folder that is named, or beside a file that is named."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(trial, "SECONDS", 1.9)
    hangs = broken("hangs")
    (tmp_path / "split").mkdir()
    shutil.copy(hangs, "split/iqtt-test-answers.h5")
    with h5py.File("split/iqtt-test.h5", "w") as file:
        file["questions"] = np.zeros((1, 4, 2, 2, 3), "u1")
    Path("a.json").write_text("[0]")
    program, *arguments = command.split()
    done = CliRunner().invoke(getattr(cli, program), arguments)
    assert done.exit_code == 2
    assert "HDF5 had not read" in done.output
