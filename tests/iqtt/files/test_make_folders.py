"""Folders of splits: what is replaced and what is not, and runs that end early."""

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest
from made_splits import TINY, StopError, listing

from iqtt.files import make as module
from iqtt.files.make import make_split
from iqtt.files.shards import ALL_FILES as FILES
from iqtt.shapes.splits import TooFewShapesError
from scenegen.common.errors import PlacementError, SpecError
from scenegen.files.workspace import remove_leftovers

KILLED = """
import os, signal, sys
from iqtt.questions.specs import SplitSpec
from iqtt.files.make import make_split
kill = lambda done: os.kill(os.getpid(), signal.SIGKILL)
make_split(sys.argv[1], SplitSpec.from_json(sys.argv[2]), batch=1, overwrite=True, progress=kill)
"""


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("made") / "split"
    make_split(folder, TINY)
    return folder


@pytest.fixture
def old(made: Path, tmp_path: Path) -> Path:
    """The folder of an older split."""
    folder = tmp_path / "old"
    folder.mkdir()
    for name, raw in listing(made).items():
        (folder / name).write_bytes(raw)
    return folder


def test_an_older_split_is_replaced_only_on_request(old, tmp_path):
    before = listing(tmp_path)
    with pytest.raises(FileExistsError):
        make_split(old, replace(TINY, seed=2))
    assert listing(tmp_path) == before
    (old / "iqtt-val.h5").unlink()
    beside = set()
    look = lambda _: beside.update(os.listdir(tmp_path))  # noqa: E731
    make_split(old, replace(TINY, seed=2), overwrite=True, progress=look)
    assert len(beside) == 2, "the new one is made beside the old one"
    after = listing(tmp_path)
    assert set(after) == set(before)
    assert all(after[f"old/{name}"] != before[f"old/{name}"] for name in FILES)


def test_the_folder_that_one_is_in_is_filled_where_it_is(old, tmp_path, monkeypatch):
    (tmp_path / "empty").mkdir()
    monkeypatch.chdir(tmp_path / "empty")
    make_split(".", TINY, overwrite=True)
    assert listing(Path()) == listing(old)


def test_a_killed_run_is_in_nobody_s_way(old, tmp_path):
    """Killed while it makes the split, and then started again."""
    command = [sys.executable, "-c", KILLED, old, replace(TINY, seed=2).to_json()]
    for folder in (old, tmp_path / "new"):
        before = listing(old)
        command[3] = str(folder)
        assert subprocess.run(command, check=False, capture_output=True).returncode == -9
        assert listing(old) == before
        assert len(os.listdir(tmp_path)) == 2, "the split and what the killed run left"
        with pytest.warns(UserWarning, match="partial"):
            remove_leftovers(tmp_path)
        make_split(folder, replace(TINY, seed=2), overwrite=True)
        assert sorted(os.listdir(folder)) == sorted(FILES)


@pytest.mark.parametrize(
    "stranger", ["notes.txt", "iqtt-test-predictions.h5", ".hidden", "iqtt-train.h5/"]
)
def test_a_folder_with_other_things_is_never_replaced(stranger, old, tmp_path):
    if stranger.endswith("/"):
        (old / stranger).unlink()
        (old / stranger).mkdir()
    else:
        (old / stranger).write_text("mine")
    before = listing(tmp_path)
    with pytest.raises(FileExistsError) as error:
        make_split(old, TINY, overwrite=True)
    assert stranger.rstrip("/") in str(error.value.strerror)
    assert error.value.filename == str(old)
    assert listing(tmp_path) == before


def test_places_that_cannot_be_a_folder_are_refused_before_anything_is_made(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "make_pools", None)
    (tmp_path / "file").write_text("mine")
    (tmp_path / "nowhere").symlink_to(tmp_path / "gone")
    before = listing(tmp_path)
    for overwrite in (False, True):
        for name, kind in (
            ("file", NotADirectoryError),
            ("file/split", NotADirectoryError),
            ("missing/split", FileNotFoundError),
            ("nowhere", OSError),
        ):
            with pytest.raises(kind):
                make_split(tmp_path / name, TINY, overwrite=overwrite)
    (tmp_path / "locked").mkdir()
    monkeypatch.setattr(os, "access", lambda path, mode: False)
    for path in ("locked", "locked/split"):
        with pytest.raises(PermissionError) as error:
            make_split(tmp_path / path, TINY, overwrite=True)
        assert error.value.filename == str(tmp_path / "locked")
    del before["file"]
    assert set(listing(tmp_path)) == {*before, "file", "locked"}


@pytest.mark.parametrize("kind", [StopError, KeyboardInterrupt])
@pytest.mark.parametrize("after", [1, 7])
def test_an_interrupted_run_leaves_all_as_it_was(kind, after, old, tmp_path):
    done = []

    def progress(count: int) -> None:
        done.append(count)
        if sum(done) >= after:
            raise kind

    before = listing(tmp_path)
    for folder in (tmp_path / "new", old):
        done.clear()
        with pytest.raises(kind):
            make_split(folder, replace(TINY, seed=2), batch=1, progress=progress, overwrite=True)
        assert listing(tmp_path) == before


def test_errors_on_the_way_leave_all_as_it_was(old, tmp_path, monkeypatch):
    before, new = listing(tmp_path), tmp_path / "new"
    with pytest.raises(SpecError):
        make_split(new, TINY, compression="zip")
    with pytest.raises(TooFewShapesError):
        make_split(new, replace(TINY, cubes=(3, 3)))
    monkeypatch.setattr("iqtt.questions.views.QUESTION_ATTEMPTS", 1)
    monkeypatch.setattr("iqtt.questions.views.VIEWS", 1)
    with pytest.raises(PlacementError):
        make_split(old, replace(TINY, height=64, width=64, min_cube_pixels=14), overwrite=True)
    monkeypatch.undo()
    monkeypatch.setattr(os, "statvfs", lambda path: SimpleNamespace(f_bavail=0, f_frsize=1))
    with pytest.raises(OSError, match="No space left on device") as error:
        make_split(new, TINY)
    assert error.value.filename == str(new / "iqtt-train.h5")
    monkeypatch.undo()
    with pytest.raises(FileExistsError):  # somebody else makes the folder meanwhile
        make_split(new, TINY, progress=lambda count: new.mkdir(exist_ok=True))
    new.rmdir()
    assert listing(tmp_path) == before
