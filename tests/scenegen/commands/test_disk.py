"""Renders that the machine stops: killed, without permission, on a full disk."""

import subprocess
import sys

import pytest

LINUX = pytest.mark.skipif(sys.platform != "linux", reason="uses Linux system calls")
# `scenegen` with a limit on the size of files, which to a program is a disk that fills up.
PR_CAPBSET_DROP, CAP_DAC_OVERRIDE = 24, 1
UNPRIVILEGED = f"""
import ctypes, os, sys
ctypes.CDLL(None).prctl({PR_CAPBSET_DROP}, {CAP_DAC_OVERRIDE}, 0, 0, 0)
command = [sys.executable, "-c", "import cli; cli.scenegen()", *sys.argv[1:]]
os.execv(sys.executable, command)
"""
RENDER = ("render", "--size", "32", "--min-visible-pixels", "3", "--seed", "3")


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


@pytest.fixture
def small_disk(tmp_path):
    """Mount disks of a given size, one after another; needs root, as CI has it."""
    place = tmp_path / "disk"
    place.mkdir()
    mounted = False

    def mount(size):
        nonlocal mounted
        if mounted:
            subprocess.run(["umount", place], check=True)
        command = ["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", place]
        mounted = subprocess.run(command, capture_output=True, check=False).returncode == 0
        if not mounted:
            pytest.skip("cannot mount a small disk here")
        return place

    yield mount
    if mounted:
        subprocess.run(["umount", place], check=True)


@LINUX
@pytest.mark.parametrize(("compression", "places"), [("gzip", (0.2, 0.98)), ("none", (0.98,))])
def test_a_full_disk_is_one_clear_line(
    tmp_path, small_disk, check_refusal, make_rooms, compression, places
):
    """Most of the file, or only its last block, does not fit: each fails at another place."""
    size = make_rooms(tmp_path / "x.h5", 12, {"compression": compression}).stat().st_size
    command = [sys.executable, "-c", "import cli; cli.scenegen()", *RENDER, "--n", "12"]
    command += ["--compression", compression, "--out", "x.h5"]
    for place in places:
        disk = small_disk(int(place * size))
        done = subprocess.run(command, cwd=disk, capture_output=True, text=True, check=False)
        line = check_refusal(done.returncode, done.stdout, done.stderr, ("x.h5", "No space left"))
        assert ".partial" not in line
        assert len(line) < 200, "a line for a person"
        assert list(disk.iterdir()) == []


@LINUX
@pytest.mark.parametrize("form", ["exr", "png", "ply", "obj"])
def test_an_export_to_a_full_disk_is_one_clear_line(small_disk, check_refusal, rooms_path, form):
    disk = small_disk(4096)
    (disk / "full").write_bytes(bytes(4096))
    command = [sys.executable, "-c", "import cli; cli.scenegen()", "export", rooms_path]
    command += ["--items", "0", "--format", form, "--out", "new"]
    done = subprocess.run(command, cwd=disk, capture_output=True, text=True, check=False)
    check_refusal(done.returncode, done.stdout, done.stderr, (form, "No space left"))
    assert [path.name for path in disk.iterdir()] == ["full"]
