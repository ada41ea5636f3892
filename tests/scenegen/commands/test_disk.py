"""Renders that the machine stops: without permission, on a full disk."""

import subprocess
import sys

import pytest

from scenegen.rooms.export.formats import ROW_FORMATS

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="uses Linux system calls")
RENDER = ("render", "--size", "32", "--min-visible-pixels", "3", "--seed", "3")


@pytest.fixture
def small_disk(tmp_path, monkeypatch):
    """Work in disks of a given size, one after another; needs root, as CI has it."""
    place = tmp_path / "disk"
    place.mkdir()
    mounted = False

    def leave():
        monkeypatch.chdir(tmp_path)
        if mounted:
            subprocess.run(["umount", place], check=True)

    def mount(size):
        nonlocal mounted
        leave()
        command = ["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", place]
        mounted = subprocess.run(command, capture_output=True, check=False).returncode == 0
        if not mounted:
            pytest.skip("cannot mount a small disk here")
        monkeypatch.chdir(place)
        return place

    yield mount
    leave()


@pytest.mark.parametrize(("compression", "shares"), [("gzip", (0.2, 0.98)), ("none", (0.98,))])
def test_a_full_disk_is_one_clear_line(
    run, small_disk, check_refusal, make_rooms, tmp_path, compression, shares
):
    """Most of the file, or only its last block, does not fit: each fails at another place."""
    size = make_rooms(tmp_path / "x.h5", 12, {"compression": compression}).stat().st_size
    for share in shares:
        disk = small_disk(int(share * size))
        done = run(*RENDER, "--n", "12", "--compression", compression, "--out", "x.h5")
        words = ("x.h5", "No space left")
        line = check_refusal(done.exit_code, done.stdout, done.stderr, words)
        assert ".partial" not in line
        assert list(disk.iterdir()) == []


@pytest.mark.parametrize("form", ROW_FORMATS)
def test_an_export_to_a_full_disk_is_one_clear_line(
    run, small_disk, check_refusal, rooms_path, form
):
    disk = small_disk(4096)
    (disk / "full").write_bytes(bytes(4096))
    done = run("export", rooms_path, "--items", "0", "--format", form, "--out", "new")
    check_refusal(done.exit_code, done.stdout, done.stderr, (form, "No space left"))
    assert [path.name for path in disk.iterdir()] == ["full"]
