"""Files on which HDF5 itself hangs or crashes, found by changing bytes of files that it wrote."""

import os
import shutil
import subprocess
import sys
import zlib
from pathlib import Path

import h5py
import numpy as np
import pytest
from click.testing import CliRunner

import cli
from scenegen.common.errors import FileFormatError
from scenegen.files import trial
from scenegen.files.trial import try_file

HOSTILE = Path(__file__).parents[2] / "support" / "hostile"


@pytest.fixture
def broken(tmp_path):
    """Return a function that unpacks a file of this name."""

    def unpack(name):
        path = tmp_path / f"{name}.h5"
        path.write_bytes(zlib.decompress((HOSTILE / f"{path.name}.z").read_bytes()))
        return path

    return unpack


def test_a_file_on_which_hdf5_hangs(broken, monkeypatch):
    monkeypatch.setattr(trial, "SECONDS", 0.9)
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


def test_files_that_another_process_can_read(rooms_path, tmp_path, monkeypatch):
    """Each is tried once, and again when it has changed."""
    (tmp_path / "text").write_text("no HDF5")
    path = shutil.copy(rooms_path, tmp_path / "rooms.h5")
    for file in (path, tmp_path / "text", tmp_path / "nothing", tmp_path):
        try_file(file)
    monkeypatch.setattr(trial, "PATIENCE", 0)
    try_file(path)
    with h5py.File(path, "r+") as file:
        file.attrs["more"] = "x" * 1000
    with pytest.raises(FileFormatError) as error:
        try_file(path)
    assert "had not read after 0 s" in error.value.found


LIMITED = """
import resource, sys
from scenegen.files import trial
kind, most = getattr(resource, sys.argv[2]), int(sys.argv[3])
import numpy, h5py  # of the program, which needs no more memory then
resource.setrlimit(kind, (most, most))
if len(sys.argv) > 4:
    trial.python_command = lambda code: [sys.executable, "-c", sys.argv[4]]
try:
    trial.try_file(sys.argv[1])
except trial.FileFormatError as error:
    print("file:", error)
except trial.SceneGenError as error:
    print("trial:", error)
"""
BUSY = "print('ready cpu', flush=True)\nwhile True: pass"


@pytest.mark.skipif(sys.platform != "linux", reason="limits of Linux")
@pytest.mark.parametrize(
    ("name", "kind", "most", "code", "said"),
    [
        ("sound", "RLIMIT_AS", 2 * 10**9, "", ""),
        ("crashes", "RLIMIT_CPU", 5, "", "file: "),
        ("sound", "RLIMIT_CPU", 1, BUSY, "trial: "),
        *(
            pytest.param("sound", *rest, marks=pytest.mark.slow)
            for rest in (
                ("RLIMIT_CPU", 5, "", ""),
                ("RLIMIT_AS", 2 * 10**9, "print('ready memory'); exit(3)", "trial: "),
                ("RLIMIT_AS", 2 * 10**9, "1 / 0", "trial: "),
            )
        ),
    ],
)
def test_limits_of_this_process_are_no_fault_of_the_file(
    name, kind, most, code, said, broken, rooms_path
):
    path = rooms_path if name == "sound" else broken(name)
    words = [sys.executable, "-c", LIMITED, path, kind, str(most), *filter(None, [code])]
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[3])}
    done = subprocess.run(words, capture_output=True, text=True, check=False, env=environment)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith(said)
    assert bool(done.stdout) == bool(said)


@pytest.mark.tried
@pytest.mark.parametrize(
    "command",
    [
        "bench validate crashes.h5",
        "bench score crashes.h5 --truth rooms.h5",
        "bench view crashes.h5 --truth rooms.h5",
        "bench score answers.h5",
    ],
)
def test_submissions_and_the_truths_that_they_name_are_tried_first(
    command, broken, tmp_path, monkeypatch, rooms_path
):
    monkeypatch.chdir(tmp_path)
    broken("crashes")
    shutil.copy(rooms_path, "rooms.h5")
    with h5py.File("answers.h5", "w") as file:
        texts = {"format": "pix2shape-bench/predictions", "format_version": "1.0"}
        texts |= {"task": "iqtt", "method": "m", "truth_fingerprint": ""}
        texts["truth_path"] = "crashes.h5"
        file.attrs.update(texts)
        file["question"], file["answer"] = np.arange(3), np.zeros(3, "i1")
    program, *arguments = command.split()
    done = CliRunner().invoke(getattr(cli, program), arguments)
    assert done.exit_code in (1, 2)
    assert "HDF5 crashes" in done.output
