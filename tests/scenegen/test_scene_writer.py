"""Nothing half-written ever carries the final name, whatever goes wrong."""

import os
import signal
import subprocess
import sys
import time

import h5py
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenegen.dataset import render_items
from scenegen.errors import SpecError
from scenegen.packing import pack
from scenegen.scene_writer import RoomsWriter, shuffle_bytes
from scenegen.specs import DatasetSpec

LINUX = pytest.mark.skipif(sys.platform != "linux", reason="uses Linux system calls")
SPEC = DatasetSpec(height=32, width=32, min_visible_pixels=3, seed=3)
# `scenegen` with a limit on the size of files, which to a program is a disk that fills up.
LIMITED = """
import os, resource, signal, sys
missing = float(sys.argv.pop(1))
import cli
cli.scenegen(standalone_mode=False)
size = os.path.getsize("x.h5")
os.remove("x.h5")
limit = int(size * missing) if missing < 1 else size - int(missing)
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
sys.stdout = open(os.devnull, "w")
cli.scenegen()
"""
PR_CAPBSET_DROP, CAP_DAC_OVERRIDE = 24, 1
UNPRIVILEGED = f"""
import ctypes, os, sys
ctypes.CDLL(None).prctl({PR_CAPBSET_DROP}, {CAP_DAC_OVERRIDE}, 0, 0, 0)
command = [sys.executable, "-c", "import cli; cli.scenegen()", *sys.argv[1:]]
os.execv(sys.executable, command)
"""
RENDER = ("render", "--size", "32", "--min-visible-pixels", "3", "--seed", "3")


@pytest.fixture(scope="module")
def rows():
    """Return 4 rendered rooms and their packed scenes: what `append` takes."""
    rooms = [room for part in render_items(SPEC, range(4), 4) for room in part]
    return rooms, pack(SPEC, [room.scene for room in rooms])


def test_only_a_complete_file_gets_the_final_name(tmp_path, rows):
    path = tmp_path / "x.h5"
    with RoomsWriter(path, SPEC, 4) as writer:
        assert not path.exists()
        writer.append(*rows)
        assert not path.exists()
        assert len(list(tmp_path.iterdir())) == 1
    assert [p.name for p in tmp_path.iterdir()] == ["x.h5"]


def test_an_exception_removes_the_temporary_file_and_passes(tmp_path, rows):
    with pytest.raises(ZeroDivisionError):
        write_and_fail(tmp_path / "x.h5", rows)
    assert list(tmp_path.iterdir()) == []


def test_too_few_rows_make_no_file(tmp_path, rows):
    with (
        pytest.raises(RuntimeError, match="got 4 of 5 rows"),
        RoomsWriter(tmp_path / "x.h5", SPEC, 5) as writer,
    ):
        writer.append(*rows)
    assert list(tmp_path.iterdir()) == []


def test_an_existing_file_is_kept_without_overwrite(tmp_path):
    path = tmp_path / "x.h5"
    path.write_text("mine")
    with pytest.raises(FileExistsError, match="say --overwrite"):
        RoomsWriter(path, SPEC, 4)
    assert path.read_text() == "mine"
    assert list(tmp_path.iterdir()) == [path]


def test_a_file_that_appears_meanwhile_is_kept(tmp_path, rows):
    path = tmp_path / "x.h5"
    writer = RoomsWriter(path, SPEC, 4)
    writer.append(*rows)
    path.write_text("someone else's")
    with pytest.raises(FileExistsError):
        writer.__exit__(None, None, None)
    assert path.read_text() == "someone else's"
    assert list(tmp_path.iterdir()) == [path]


def test_overwrite_replaces_only_when_complete(tmp_path, rows):
    path = tmp_path / "x.h5"
    path.write_text("old")
    with pytest.raises(ZeroDivisionError):
        write_and_fail(path, rows, overwrite=True)
    assert path.read_text() == "old"
    with RoomsWriter(path, SPEC, 4, overwrite=True) as writer:
        writer.append(*rows)
        assert path.read_text() == "old"
    with h5py.File(path) as file:
        assert file["image"].shape == (4, 32, 32, 3)


def test_paths_that_cannot_be_written(tmp_path):
    (tmp_path / "file").write_text("")
    for path, error in (
        (tmp_path / "none" / "x.h5", FileNotFoundError),
        (tmp_path, IsADirectoryError),
        (tmp_path / "file" / "x.h5", NotADirectoryError),
    ):
        with pytest.raises(error) as caught:
            RoomsWriter(path, SPEC, 4, overwrite=True)
        assert caught.value.filename is not None
    assert [p.name for p in tmp_path.iterdir()] == ["file"]


def test_something_that_is_no_regular_file_is_never_replaced(tmp_path):
    """As /dev/null would be, by a rename as root."""
    path = tmp_path / "pipe"
    os.mkfifo(path)
    with pytest.raises(OSError, match="file"), RoomsWriter(path, SPEC, 4, overwrite=True):
        pass
    assert path.is_fifo()
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(("count", "compression"), [(0, "gzip"), (-1, "gzip"), (1, "zip")])
def test_bad_settings(tmp_path, count, compression):
    with pytest.raises(SpecError, match="found"):
        RoomsWriter(tmp_path / "x.h5", SPEC, count, compression=compression)
    assert list(tmp_path.iterdir()) == []


@LINUX
def test_a_folder_without_write_permission(tmp_path, check_refusal):
    """Root gives up the right to write anywhere, so that this tests something for root too."""
    folder = tmp_path / "locked"
    folder.mkdir()
    folder.chmod(0o555)
    done = subprocess.run(
        [sys.executable, "-c", UNPRIVILEGED, *RENDER, "--n", "1", "--out", "locked/x.h5"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    check_refusal(done.returncode, done.stdout, done.stderr, ("locked: cannot be written to",))
    assert list(folder.iterdir()) == []


def test_a_killed_render_leaves_nothing_under_the_final_name(tmp_path):
    command = [sys.executable, "-c", "import cli; cli.scenegen()", *RENDER, "--n", "100000"]
    process = subprocess.Popen([*command, "--out", "x.h5"], cwd=tmp_path, stderr=subprocess.DEVNULL)
    try:
        wait_until(lambda: any(p.stat().st_size > 100_000 for p in tmp_path.iterdir()), process)
    finally:
        process.send_signal(signal.SIGKILL)
        process.wait()
    assert not (tmp_path / "x.h5").exists()
    assert list(tmp_path.iterdir()), "the run was killed before it wrote anything: a weak test"
    subprocess.run([*command[:-1], "2", "--out", "x.h5"], cwd=tmp_path, check=True)
    assert (tmp_path / "x.h5").exists()


@LINUX
@pytest.mark.parametrize(
    ("compression", "missing"),
    [("gzip", 0.5), ("gzip", 2000), ("gzip", 1), ("lzf", 0.5), ("none", 1)],
)
def test_a_full_disk_is_one_clear_line(tmp_path, check_refusal, compression, missing):
    """Half of the file, its last block, its last byte do not fit: each fails at another place."""
    render = [*RENDER, "--n", "12", "--out", "x.h5", "--compression", compression]
    done = subprocess.run(
        [sys.executable, "-c", LIMITED, str(missing), *render],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    out = done.stdout.partition("\n")[2]  # the first line is that of the complete run
    line = check_refusal(done.returncode, out, done.stderr, ("x.h5", "File too large"))
    assert ".partial" not in line
    assert len(line) < 200, "a line for a person"
    assert list(tmp_path.iterdir()) == []


@given(
    st.binary(min_size=0, max_size=48).map(lambda data: data * 8),
    st.sampled_from(["uint8", "int16", "float32", "float64"]),
)
def test_shuffle_is_that_of_hdf5(data, dtype):
    values = np.frombuffer(data or bytes(8), "uint8").view(dtype)
    with h5py.File("shuffled", "w", driver="core", backing_store=False) as file:
        dataset = file.create_dataset("x", values.shape, dtype, chunks=values.shape, shuffle=True)
        dataset.id.write_direct_chunk((0,), shuffle_bytes(values).tobytes())
        assert dataset[...].tobytes() == values.tobytes()


def write_and_fail(path, rows, overwrite=False):
    with RoomsWriter(path, SPEC, 4, overwrite=overwrite) as writer:
        writer.append(*rows)
        raise ZeroDivisionError


def wait_until(condition, process, seconds=60):
    end = time.monotonic() + seconds
    while not condition():
        assert process.poll() is None, "ended too early"
        assert time.monotonic() < end, "never happened"
        time.sleep(0.02)
