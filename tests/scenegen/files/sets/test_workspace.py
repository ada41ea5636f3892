"""Runs that share a folder, and what killed runs leave there; each run is a process of its own."""

import errno
import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from signals_at_lines import interrupted_at_each_line

from scenegen.common import signals
from scenegen.files import new_file
from scenegen.files.new_file import write_text, written_beside
from scenegen.files.sets import workspace as module
from scenegen.files.sets.workspace import NAME, remove_leftovers

LINUX = pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such locks")
KILLED = """
import os, signal, sys
from scenegen.files.new_file import written_beside
with written_beside(sys.argv[1]) as temporary:
    temporary.write_bytes(bytes(2_000_000))
    os.kill(os.getpid(), signal.SIGKILL)
"""
WAITING = """
import sys
from scenegen.files.new_file import written_beside
with written_beside(sys.argv[1]) as temporary:
    temporary.write_text("begun")
    print("begun", flush=True)
    sys.stdin.read()
"""
SAME_NAMES = """
import itertools, secrets, sys
from scenegen.files.new_file import written_beside
numbers = itertools.count()
secrets.token_hex = lambda size: f"{next(numbers):0{2 * size}x}"
sys.stdin.readline()
for i in range(200):
    with written_beside(f"{sys.argv[1]}-{i}") as temporary:
        temporary.write_text(sys.argv[1])
"""


def start(code: str, *arguments: object) -> subprocess.Popen[str]:
    command = [sys.executable, "-c", code, *map(str, arguments)]
    return subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)


@pytest.fixture
def left(tmp_path: Path) -> Path:
    """What a killed run left."""
    process = start(KILLED, tmp_path / "killed.h5")
    process.communicate()
    assert process.returncode == -9
    (left,) = tmp_path.iterdir()
    assert NAME.fullmatch(left.name)
    return left


def text_of(call, *arguments) -> str:
    """The one warning that a call gives."""
    with pytest.warns(UserWarning, match="partial") as told:
        call(*arguments)
    (warning,) = told
    return str(warning.message)


@LINUX
def test_what_a_killed_run_left_is_removed_and_named(left, tmp_path):
    text = text_of(write_text, tmp_path / "next.txt", "mine")
    assert str(left) in text
    assert "2.0 MB" in text
    assert os.listdir(tmp_path) == ["next.txt"]


@LINUX
def test_what_another_machine_may_still_write_is_only_named(left, tmp_path):
    other = left.rename(left.with_name(left.name.replace(left.name[17:25], "0123abcd")))
    assert str(other) in text_of(remove_leftovers, tmp_path)
    assert (other / "file.h5").stat().st_size == 2_000_000


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM], ids=str)
def test_a_signal_leaves_nothing_whenever_it_comes(tmp_path, number):
    """Before each line of the code that makes a file, on the way in and on the way out."""
    path = tmp_path / "a.txt"
    write_text(path, "the first in a folder, which is looked at")
    path.unlink()
    for at in interrupted_at_each_line(
        lambda: write_text(path, "whole"), (module, new_file, signals), number
    ):
        assert {p.name: p.read_text() for p in tmp_path.iterdir()} in ({}, {"a.txt": "whole"}), at
        path.unlink(missing_ok=True)
    assert at > 100
    assert path.read_text() == "whole"


@LINUX
def test_where_nothing_can_be_locked_nothing_is_removed(left, tmp_path, monkeypatch):
    def refuses(*_: object) -> None:
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    monkeypatch.setattr(module.fcntl, "flock", refuses)
    write_text(tmp_path / "next.txt", "mine")
    assert sorted(os.listdir(tmp_path)) == sorted([left.name, "next.txt"])


@LINUX
def test_a_run_killed_before_it_wrote_anything_is_not_worth_a_word(left, tmp_path):
    for path in left.iterdir():
        path.unlink()
    write_text(tmp_path / "next.txt", "mine")
    assert os.listdir(tmp_path) == ["next.txt"]


@pytest.mark.parametrize("name", ["notes", ".pix2shape-bench-notes.partial"])
def test_folders_and_links_of_others_are_left_alone(left, tmp_path, name):
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "file").write_text("mine")
    kept = left.rename(tmp_path / name)
    link = left.with_name(left.name)
    link.symlink_to(tmp_path / "mine")
    write_text(tmp_path / "next.txt", "mine")
    assert (tmp_path / "mine" / "file").exists()
    assert (kept / "file.h5").exists()


@LINUX
def test_what_lives_is_never_removed(tmp_path):
    process = start(WAITING, tmp_path / "slow.txt")
    assert process.stdout.readline() == "begun\n"
    write_text(tmp_path / "next.txt", "mine")
    remove_leftovers(tmp_path)
    process.communicate()
    assert process.returncode == 0
    assert sorted(os.listdir(tmp_path)) == ["next.txt", "slow.txt"]


@LINUX
def test_two_runs_that_draw_the_same_names_at_once(tmp_path):
    runs = [start(SAME_NAMES, tmp_path / name) for name in "ab"]
    for run in runs:
        run.stdin.write("go\n")
        run.stdin.flush()
    for run in runs:
        run.communicate()
        assert run.returncode == 0
    texts = {path.name: path.read_text() for path in tmp_path.iterdir()}
    assert texts == {f"{name}-{i}": str(tmp_path / name) for name in "ab" for i in range(200)}


@LINUX
def test_runs_and_their_cleaners_at_once(tmp_path):
    """Whenever a cleaner looks, it takes nothing from a run that lives."""
    failed: list[BaseException] = []

    def write(name: str) -> None:
        try:
            for i in range(150):
                remove_leftovers(tmp_path)
                write_text(tmp_path / f"{name}-{i}", name)
        except BaseException as error:
            failed.append(error)

    threads = [threading.Thread(target=write, args=(name,)) for name in "abcd"]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert failed == []
    assert {p.name: p.read_text() for p in tmp_path.iterdir()} == {
        f"{name}-{i}": name for name in "abcd" for i in range(150)
    }


@LINUX
@pytest.mark.parametrize("moment", ["before it is locked", "while it is locked", "gone"])
def test_a_cleaner_between_making_and_locking(tmp_path, monkeypatch, moment):
    """The run takes another name."""
    real, flock, seen = module._locked, module.fcntl.flock, []

    def locks(folder: Path) -> int | None:
        seen.append(folder)
        if len(seen) == 1 and moment == "before it is locked":
            remove_leftovers(tmp_path)
        elif len(seen) == 1 and moment == "while it is locked":
            flock(os.open(folder, os.O_RDONLY), module.fcntl.LOCK_EX)
        return real(folder)

    def removed(lock: int, how: int) -> None:
        flock(lock, how)
        if len(seen) == 1:
            seen[0].rmdir()

    monkeypatch.setattr(module, "_locked", locks)
    if moment == "gone":
        monkeypatch.setattr(module.fcntl, "flock", removed)
    with written_beside(tmp_path / "next.txt") as temporary:
        temporary.write_text("mine")
        assert temporary.parent != seen[0]
    assert (tmp_path / "next.txt").read_text() == "mine"


@pytest.mark.parametrize(
    ("said", "number"),
    [
        ('Failed to write pixel data to image file "x". No space left on device.', errno.ENOSPC),
        ("errno = 27, error message = 'File too large', buf = 0x1", errno.EFBIG),
    ],
)
def test_what_a_library_says_of_the_disk_is_an_error_of_the_disk(tmp_path, said, number):
    with (
        pytest.raises(OSError, match="cannot be written") as error,
        written_beside(tmp_path / "x.exr"),
    ):
        raise RuntimeError(said)
    assert (error.value.filename, error.value.errno) == (str(tmp_path / "x.exr"), number)


@pytest.mark.parametrize(
    "raised",
    [
        RuntimeError("a bug"),
        FileNotFoundError(2, "none", "input.h5"),
        BrokenPipeError(32, "Broken pipe"),
    ],
)
def test_errors_that_are_not_the_output_s_pass_as_they_are(tmp_path, raised):
    with pytest.raises(type(raised)) as error, written_beside(tmp_path / "x.exr"):
        raise raised
    assert error.value is raised
    assert list(tmp_path.iterdir()) == []
