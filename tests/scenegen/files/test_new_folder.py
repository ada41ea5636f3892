"""Folders that replace older ones: at every moment all files are of one run, or none is there."""

import errno
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from signals_at_lines import interrupted_at_each_line

from scenegen.files import new_folder
from scenegen.files.new_folder import folder_written_beside

NAMES = ("a", "b", "c")
LINUX = pytest.mark.skipif(sys.platform != "linux", reason="uses Linux system calls")
# Writes a folder, and is killed as it is about to change the number-th name, or not at all.
KILLED = """
import ctypes, errno, os, signal, sys
from pathlib import Path
from scenegen.files import new_folder
path, number, exchanges, moves = sys.argv[1], *map(int, sys.argv[2:])
real, done = {name: getattr(os, name) for name in ("rename", "replace", "unlink")}, [0]
def counted(name):
    def call(*arguments, **named):
        done[0] += 1
        if done[0] == number:
            os.kill(os.getpid(), signal.SIGKILL)
        return real[name](*arguments, **named)
    return call
if not exchanges:
    ctypes.CDLL = lambda name: None
def busy(*names):
    raise OSError(errno.EBUSY, "busy")
if not moves:
    os.rename = busy
with new_folder.folder_written_beside(path, "abc", overwrite=True) as made:
    for name in "abc":
        (made / name).write_text("new")
    for name in real:
        setattr(os, name, counted(name))
print("done")
"""


def write(folder: Path, text: str, names: tuple[str, ...] = NAMES) -> None:
    with folder_written_beside(folder, NAMES, overwrite=True) as made:
        for name in names:
            (made / name).write_text(text)


def texts(folder: Path) -> dict[str, str]:
    return {path.name: path.read_text() for path in folder.iterdir() if path.is_file()}


def whole(text: str) -> dict[str, str]:
    return dict.fromkeys(NAMES, text)


@LINUX
@pytest.mark.filterwarnings("ignore:removed what an earlier run left")
@pytest.mark.parametrize(("exchanges", "moves"), [(1, 1), (0, 1), (1, 0)])
def test_killed_at_every_step(tmp_path, exchanges, moves):
    """The folder is the old one, the new one or not whole, and never mixed; the next run works."""
    for number in range(1, 30):
        folder = tmp_path / str(number) / "split"
        folder.parent.mkdir()
        write(folder, "old")
        command = [sys.executable, "-c", KILLED, folder, str(number), str(exchanges), str(moves)]
        done = subprocess.run(command, check=False, capture_output=True, text=True)
        found = texts(folder) if folder.exists() else {}
        assert set(found.values()) in ({"old"}, {"new"}, set()), (number, found)
        if exchanges and moves:
            assert found in (whole("old"), whole("new"))
        if done.stdout:
            assert found == whole("new")
            assert os.listdir(folder.parent) == ["split"]
            break
        write(folder, "again")
        assert texts(folder) == whole("again")
        assert sorted(os.listdir(folder)) == list(NAMES)
    else:
        pytest.fail("never came to its end")
    assert number > 3


@LINUX
@pytest.mark.parametrize("place", ["exchanged", "renamed", "filled"])
def test_a_signal_never_takes_the_old_folder_without_the_new_one(tmp_path, monkeypatch, place):
    """Before each line of the code that replaces it."""
    folder = tmp_path / "split"
    if place == "renamed":
        monkeypatch.setattr(new_folder, "_exchanged", lambda one, other: False)
    elif place == "filled":
        monkeypatch.setattr(new_folder, "_can_be_renamed", lambda folder: False)
    write(folder, "old")
    run = lambda: write(folder, "new")  # noqa: E731
    for at in interrupted_at_each_line(run, (new_folder,), signal.SIGINT):
        assert texts(folder) in (whole("old"), whole("new")), at
        assert os.listdir(tmp_path) == ["split"]
        assert sorted(os.listdir(folder)) == list(NAMES)
        write(folder, "old")
    assert at > 20
    assert texts(folder) == whole("new")


@LINUX
@pytest.mark.parametrize("place", ["mount", "working folder", "parent"])
def test_a_folder_that_cannot_be_renamed_is_filled_where_it_is(tmp_path, monkeypatch, place):
    folder = tmp_path / "split"
    write(folder, "old")
    if place == "mount":
        command = ["mount", "--bind", folder, folder]
        if subprocess.run(command, check=False, capture_output=True).returncode:
            pytest.skip("cannot mount here")
    elif place == "working folder":
        monkeypatch.chdir(folder)
    else:
        real = Path.mkdir
        refuse = lambda path, **how: real(path if path.parent != tmp_path else Path("/proc/no"))  # noqa: E731
        monkeypatch.setattr(Path, "mkdir", refuse)
    before = folder.stat().st_ino
    try:
        assert set(texts(folder)) == {"a", "b", "c"}
        write(folder, "new", ("a", "c"))
        assert texts(folder) == {"a": "new", "c": "new"}
        assert sorted(os.listdir(folder)) == ["a", "c"]
        assert folder.stat().st_ino == before
    finally:
        if place == "mount":
            subprocess.run(["umount", folder], check=True)


def test_a_folder_keeps_its_permissions(tmp_path):
    folder = tmp_path / "split"
    write(folder, "old")
    folder.chmod(0o750)
    write(folder, "new")
    assert (texts(folder), folder.stat().st_mode & 0o777) == (whole("new"), 0o750)
    assert os.listdir(tmp_path) == ["split"]


@pytest.mark.parametrize("renames", [True, False])
def test_what_others_put_there_meanwhile_is_not_lost(tmp_path, monkeypatch, renames):
    folder = tmp_path / "split"
    write(folder, "old")

    def busy(*_: object) -> None:
        raise OSError(errno.EBUSY, "busy")

    if not renames:
        monkeypatch.setattr(os, "rename", busy)

    def write_and_be_disturbed() -> None:
        with folder_written_beside(folder, NAMES, overwrite=True) as made:
            (made / "a").write_text("new")
            (folder / "notes").write_text("mine")

    with pytest.raises(FileExistsError, match="notes"):
        write_and_be_disturbed()
    assert texts(folder) == {**whole("old"), "notes": "mine"}
    assert sorted(os.listdir(folder)) == ["a", "b", "c", "notes"]


def test_a_run_that_writes_into_the_folder_is_a_stranger(tmp_path):
    folder = tmp_path / "split"
    write(folder, "old")
    with (
        folder_written_beside(folder / "inner", NAMES),
        pytest.raises(FileExistsError, match="partial"),
    ):
        write(folder, "new")
    assert texts(folder) == whole("old")


@pytest.mark.parametrize("path", ["", "link", "nowhere"])
def test_an_empty_path_and_links_are_refused(tmp_path, monkeypatch, path):
    monkeypatch.chdir(tmp_path)
    write(Path("split"), "old")
    Path("link").symlink_to("split")
    Path("nowhere").symlink_to("gone")
    with (
        pytest.raises(OSError, match=r"symbolic link|empty"),
        folder_written_beside(path, NAMES, overwrite=True),
    ):
        pytest.fail("it would be written")
    assert texts(Path("split")) == whole("old")
