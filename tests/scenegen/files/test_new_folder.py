"""Folders that replace older ones: at every moment the files are of one run."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from signals_at_lines import interrupted_at_each_line

from scenegen.files import new_file
from scenegen.files.new_file import folder_written_beside

NAMES = ("a", "b", "c")
# Writes a folder, and is killed as it is about to change the number-th name, or not at all.
KILLED = """
import os, signal, sys
from scenegen.files import new_file
path, number = sys.argv[1], int(sys.argv[2])
real, done = {name: getattr(os, name) for name in ("rename", "replace", "unlink")}, [0]
def counted(name):
    def call(*arguments, **named):
        done[0] += 1
        if done[0] == number:
            os.kill(os.getpid(), signal.SIGKILL)
        return real[name](*arguments, **named)
    return call
with new_file.folder_written_beside(path, "abc", overwrite=True) as made:
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


@pytest.mark.skipif(sys.platform == "win32", reason="sends signals")
@pytest.mark.filterwarnings("ignore:removed files of an earlier")
@pytest.mark.parametrize("older", [False, True])
def test_killed_at_every_step(tmp_path, older):
    """A new folder is whole or not there; an older one is never mixed; the next run works."""
    for number in range(1, 30):
        folder = tmp_path / str(number) / "split"
        folder.parent.mkdir()
        if older:
            write(folder, "old")
        command = [sys.executable, "-c", KILLED, folder, str(number)]
        done = subprocess.run(command, check=False, capture_output=True, text=True)
        found = texts(folder) if folder.exists() else {}
        assert len(set(found.values())) <= 1, (number, found)
        if done.stdout:
            break
        assert older or not folder.exists()
        write(folder, "again")
        assert texts(folder) == whole("again")
        assert sorted(os.listdir(folder)) == list(NAMES)
    assert found == whole("new")
    assert os.listdir(folder.parent) == ["split"]
    assert number > (6 if older else 1)


@pytest.mark.parametrize("older", [False, True])
def test_a_signal_leaves_the_files_of_one_run(tmp_path, older):
    """Before each line of the code that replaces them."""
    folder = tmp_path / "split"
    expected = [whole("old"), whole("new")] if older else [{}, whole("new")]
    if older:
        write(folder, "old")
    run = lambda: write(folder, "new")  # noqa: E731
    for at in interrupted_at_each_line(run, (new_file,), signal.SIGINT):
        assert (texts(folder) if folder.exists() else {}) in expected, at
        for path in folder.glob("*"):
            path.unlink()
        if older:
            write(folder, "old")
        elif folder.exists():
            folder.rmdir()
        assert os.listdir(tmp_path) == (["split"] if older else [])
    assert at > 15
    assert texts(folder) == whole("new")


def test_an_older_folder_stays_and_keeps_its_permissions(tmp_path, monkeypatch):
    """So it may be a mount point, or the working directory."""
    folder = tmp_path / "split"
    write(folder, "old")
    folder.chmod(0o750)
    before = folder.stat()
    monkeypatch.chdir(folder)
    write(Path(), "new", ("a", "c"))
    assert texts(folder) == {"a": "new", "c": "new"}
    assert sorted(os.listdir(folder)) == ["a", "c"]
    assert os.listdir(tmp_path) == ["split"]
    assert (folder.stat().st_ino, folder.stat().st_mode) == (before.st_ino, before.st_mode)


def test_what_others_put_there_meanwhile_is_not_lost(tmp_path):
    folder = tmp_path / "split"
    write(folder, "old")

    def write_and_be_disturbed() -> None:
        with folder_written_beside(folder, NAMES, overwrite=True) as made:
            (made / "a").write_text("new")
            (folder / "notes").write_text("mine")

    with pytest.raises(FileExistsError, match="notes"):
        write_and_be_disturbed()
    assert texts(folder) == {**whole("old"), "notes": "mine"}
    assert sorted(os.listdir(folder)) == ["a", "b", "c", "notes"]


@pytest.mark.parametrize(
    ("path", "kind"),
    [
        ("", OSError),
        ("link", OSError),
        ("nowhere", OSError),
        ("file", NotADirectoryError),
        ("file/split", NotADirectoryError),
        ("missing/split", FileNotFoundError),
    ],
)
def test_places_that_no_folder_is_written_to(tmp_path, monkeypatch, path, kind):
    monkeypatch.chdir(tmp_path)
    write(Path("split"), "old")
    Path("file").write_text("mine")
    Path("link").symlink_to("split")
    Path("nowhere").symlink_to("gone")
    before = sorted(tmp_path.rglob("*"))
    for overwrite in (True, False):
        with pytest.raises(kind), folder_written_beside(path, NAMES, overwrite):
            pytest.fail("it would be written")
    assert sorted(tmp_path.rglob("*")) == before
    assert texts(Path("split")) == whole("old")
