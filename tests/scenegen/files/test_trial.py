"""Files on which HDF5 itself hangs or crashes, found by changing bytes of files that it wrote."""

import shutil
import signal
import zlib
from contextlib import closing
from pathlib import Path

import h5py
import numpy as np
import pytest
from click.testing import CliRunner

import cli
from scenegen.common.errors import FileFormatError
from scenegen.files import trial
from scenegen.files.trial import Trials, try_file, was_tried

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


def test_one_process_tries_many_files_and_another_follows_one_that_crashed(
    broken, rooms_path, tmp_path
):
    copies = [tmp_path / f"{i}.h5" for i in range(3)]
    for path in copies:
        shutil.copy(rooms_path, path)
    with closing(Trials()) as trials:
        trials.try_file(copies[0])
        first = trials._process
        trials.try_file(copies[1])
        assert trials._process is first
        with pytest.raises(FileFormatError):
            trials.try_file(broken("crashes"))
        assert first.returncode == -signal.SIGSEGV
        trials.try_file(copies[2])
        assert was_tried(copies[2])
        assert not was_tried(tmp_path / "crashes.h5")


def test_a_file_that_is_still_not_read_when_its_time_is_over(rooms_path, monkeypatch):
    monkeypatch.setattr(trial, "PATIENCE", 0)
    monkeypatch.setattr(trial, "_ACCEPTED", set())
    with pytest.raises(FileFormatError) as error:
        try_file(rooms_path)
    assert "had not read after 0 s" in error.value.found


@pytest.mark.tried
@pytest.mark.parametrize(
    ("name", "command"),
    [
        ("hangs", "scenegen info rooms.h5"),
        ("crashes", "bench baseline empty-room --data rooms.h5 --out empty.h5 --overwrite"),
    ],
)
def test_each_shard_of_a_set_is_tried_first(
    make_rooms, broken, tmp_path, monkeypatch, name, command
):
    """In one other process for all of them; the one that is broken is named."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(trial, "SECONDS", 1.9)
    make_rooms(tmp_path / "rooms.h5", 6, {"shard_size": 2})
    started, start = [], trial._started
    monkeypatch.setattr(trial, "_started", lambda: started.append(start()) or started[-1])
    program, *arguments = command.split()
    done = CliRunner().invoke(getattr(cli, program), arguments)
    assert done.exit_code == 0, done.output
    assert len(started) <= 3, "one for the file of the set, one for its shards"
    shutil.copy(broken(name), "rooms-00001-of-00003.h5")
    done = CliRunner().invoke(getattr(cli, program), arguments)
    assert done.exit_code == 2
    assert "rooms-00001-of-00003.h5" in done.output
    assert "on which HDF5 crashes" in done.output or "HDF5 had not read" in done.output
    assert all(process.returncode is not None for process in started)


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
