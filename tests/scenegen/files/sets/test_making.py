"""Sets of rooms and of questions: one file to every reader, and the same bytes whatever happens."""

import hashlib
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import h5py
import pytest
from made_sets import SEED, contents, everything, questions, rooms, same_values

from scenegen.common.errors import FileFormatError, SpecError
from scenegen.files.pool import LostWorkerError
from scenegen.files.sets.making import CompleteError, complete_parts, parts_folder
from scenegen.files.sets.shards import ROW_DIGESTS
from scenegen.rooms.render import RoomsWork

TASKS = {
    "rooms": rooms(),
    "views": rooms(views=(0.0, 40.0)),
    "questions": questions(),
    "none labelled": questions(labeled=0, with_depth=False),
}
TASK_IDS = ["rooms", "iqtt"]
BOTH = pytest.mark.parametrize("task", [TASKS["views"], TASKS["questions"]], ids=TASK_IDS)


class StopError(Exception):
    """What a test's progress bar raises."""


@pytest.fixture(
    scope="module",
    params=["views", "questions", pytest.param("none labelled", marks=pytest.mark.slow)],
)
def made(request, tmp_path_factory):
    """Return a task, and its set in shards and whole."""
    task, folder = TASKS[request.param], tmp_path_factory.mktemp("made")
    task.shards(folder / "shards")
    task.make(folder / "whole")
    return task, folder / "shards", folder / "whole"


@pytest.fixture
def copied(made, tmp_path):
    """Return the task and a copy of its shards that a test may change."""
    shutil.copytree(made[1], tmp_path / "copy")
    return made[0], tmp_path / "copy"


def stopping(after, error=StopError):
    """Return a progress bar that raises an error when more than so many rows are there."""
    rows = []

    def progress(count):
        rows.append(count)
        if sum(rows) > after:
            raise error

    return progress


def hidden(folder):
    return [path.name for path in folder.glob(".*")]


def flip(path):
    """Change a bit in the middle of a file."""
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 4
    path.write_bytes(data)


def test_plain_h5py_and_a_merge_give_the_whole_file(made, tmp_path, monkeypatch):
    monkeypatch.chdir("/")
    task, shards, whole = made
    for name in task.files:
        values, attributes = everything(shards / name)
        expected, expected_attributes = everything(whole / name)
        same_values(values, expected)
        assert attributes == expected_attributes
        task.merge(shards / name, tmp_path / name)
        assert (tmp_path / name).read_bytes() == (whole / name).read_bytes()


def test_changed_values_are_told_and_never_merged(copied, tmp_path):
    task, folder = copied
    assert all(check.ok for check in task.verify(folder))
    with h5py.File(max(folder.glob(task.files[0].replace(".h5", "-*.h5"))), "r+") as file:
        data = file["image" if "image" in file else "unlabeled/questions"]
        data[0] = data[0] ^ 1
    assert not all(check.ok for check in task.verify(folder))
    with pytest.raises(FileFormatError):
        task.merge(folder / task.files[0], tmp_path / "merged.h5")
    assert not (tmp_path / "merged.h5").exists()


def test_row_digests_are_those_of_the_rows(made):
    folder = made[1]
    with h5py.File(min(folder.glob("*-of-*.h5"))) as file:
        for number, name in enumerate(file[ROW_DIGESTS].attrs["names"]):
            values = file[name][()]
            rows = [row.tobytes() for row in values]
            if values.dtype.kind == "S":  # each text and a zero byte
                texts = values.reshape(len(values), -1).tolist()
                rows = [b"".join(text + b"\0" for text in row) for row in texts]
            expected = [hashlib.sha256(row).digest() for row in rows]
            stored = file[ROW_DIGESTS][:, number]
            assert [row.tobytes() for row in stored] == expected, name


@pytest.mark.parametrize(
    ("made", "share"), [("views", 0.0), ("questions", 0.5), ("views", 1.0)], indirect=["made"]
)
def test_a_run_goes_on_where_it_stopped(made, tmp_path, share):
    """One part is lost and one damaged; what readers open appears at the end."""
    task, folder = made[0], tmp_path / "set"
    with pytest.raises(StopError):
        task.shards(folder, progress=stopping(share * (task.rows - 1)))
    assert not contents(folder)
    kept = sorted(task.parts(folder).values()) if share else []
    if not share:
        assert not list(tmp_path.rglob("*.*")), "nothing was complete"
    else:
        lost, damaged, *kept = kept
        lost.unlink()
        flip(damaged)
    before = {path.stem: path.stat().st_mtime_ns for path in kept}
    for other in ({"seed": 9}, {"shard_size": 5}, {"compression": "none"}) if share else ():
        with pytest.raises(SpecError):
            task.shards(folder, **other)
    rows = []
    task.shards(folder, progress=rows.append)
    assert sum(rows) == task.rows
    assert {name: (folder / name).stat().st_mtime_ns for name in before} == before
    assert contents(folder) == contents(made[1])
    assert hidden(folder) == []
    with pytest.raises(CompleteError):
        task.shards(folder)


@pytest.mark.parametrize("made", ["questions"], indirect=True)
@pytest.mark.parametrize("moved", [0, 1, 5])
def test_a_run_that_stopped_while_files_got_their_names_goes_on(made, tmp_path, monkeypatch, moved):
    """Other files there are never replaced but with `overwrite`."""
    task, folder = made[0], tmp_path / "set"
    folder.mkdir()
    count = iter(range(100))

    def move(path, place):
        if place.parent == folder and next(count) >= moved:
            raise StopError
        os.replace(path, place)

    monkeypatch.setattr("scenegen.files.sets.making.move", move)
    with pytest.raises(StopError):
        task.shards(folder)
    monkeypatch.undo()
    assert contents(folder).items() <= contents(made[1]).items()
    (folder / task.files[0]).write_text("mine")
    with pytest.raises(FileExistsError):
        task.shards(folder)
    assert (folder / task.files[0]).read_text() == "mine"
    task.shards(folder, overwrite=True)
    assert contents(folder) == contents(made[1])
    assert hidden(folder) == []


@pytest.mark.parametrize(
    "task", [TASKS["views"], pytest.param(TASKS["questions"], marks=pytest.mark.slow)], ids=TASK_IDS
)
def test_files_are_replaced_only_when_told(task, tmp_path):
    """Older files stay until the new ones are complete; parts of the same request are kept."""
    folder = tmp_path / "set"
    task.shards(folder)
    before = contents(folder)
    for make in (task.make, task.shards):
        with pytest.raises(FileExistsError) as error:
            make(folder, seed=9)
        assert not isinstance(error.value, CompleteError)
    with pytest.raises(StopError):
        task.shards(folder, overwrite=True, seed=9, progress=stopping(task.rows - 1))
    assert contents(folder) == before
    kept = {name: path.stat().st_mtime_ns for name, path in task.parts(folder).items()}
    task.shards(folder, overwrite=True, seed=9)
    assert {name: (folder / name).stat().st_mtime_ns for name in kept} == kept
    assert contents(folder).keys() == before.keys()
    with pytest.raises(StopError):
        task.shards(folder, overwrite=True, seed=8, progress=stopping(task.rows - 1))
    with pytest.raises(SpecError):
        task.make(folder)
    task.make(folder, overwrite=True)
    whole = contents(folder)
    assert whole.keys() == set(task.files)
    task.shards(folder, overwrite=True)
    assert contents(folder) == before
    assert hidden(folder) == []


@BOTH
def test_files_of_others_are_kept(task, tmp_path):
    shard = task.files[0].replace(".h5", "-00001-of-00003.h5")
    for name in (shard, task.files[0]):
        folder = tmp_path / name
        folder.mkdir()
        (folder / name).write_text("mine")
        (folder / "notes").write_text("mine")
        for make in (task.make, task.shards):
            with pytest.raises(FileExistsError):
                make(folder)
        assert sorted(path.name for path in folder.iterdir()) == sorted([name, "notes"])
        assert (folder / name).read_text() == "mine"


@BOTH
def test_what_takes_a_name_meanwhile_or_fails_leaves_all_as_it_was(task, tmp_path, monkeypatch):
    """A run of one file replaces an older one only when it is complete."""
    folder = tmp_path / "set"
    task.make(folder)
    before = contents(folder)
    monkeypatch.setattr(os, "statvfs", lambda path: os.statvfs_result((1, 1) + 9 * (0,)))
    with pytest.raises(OSError, match="No space left on device") as full:
        task.make(tmp_path / "full")
    assert full.value.filename == str(tmp_path / "full" / task.files[0])
    assert not list((tmp_path / "full").glob("*"))
    if len(task.files) == 1:
        with pytest.raises(StopError):
            task.make(folder, seed=9, overwrite=True, progress=stopping(2))
        assert contents(folder) == before
        monkeypatch.undo()
        rival = tmp_path / "rival"
        rival.mkdir()
        with pytest.raises(FileExistsError):
            task.make(rival, progress=lambda rows: (rival / task.files[0]).write_text("mine"))
        assert (rival / task.files[0]).read_text() == "mine"
    assert hidden(folder) == []


@pytest.mark.parametrize("workers", [1, pytest.param(2, marks=pytest.mark.slow)])
@pytest.mark.parametrize("made", ["questions"], indirect=True)
def test_workers_and_batches_never_change_a_byte(made, tmp_path, monkeypatch, workers):
    """The fixture has batches of two; workers of one file are in the `test_make` of each task."""
    monkeypatch.setattr("iqtt.files.work.BLOCK", 2)
    made[0].shards(tmp_path / "shards", workers=workers, batch=1)
    assert contents(tmp_path / "shards") == contents(made[1])


class DyingRooms(RoomsWork):
    """Work whose process a signal ends at scene 4: once, or always."""

    def packed_rows(self, block, workers):
        tried = Path(os.environ["TRIED"])
        if 4 in block.items and (os.environ["DIES"] == "always" or not tried.exists()):
            tried.touch()
            os.kill(os.getpid(), signal.SIGSEGV)
        return (yield from super().packed_rows(block, workers))


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="sends signals")
@pytest.mark.parametrize("made", ["views"], indirect=True)
def test_no_scene_stops_a_run_for_ever(made, tmp_path, monkeypatch):
    """A crash that happens again is told with its scenes, and what is complete is kept."""
    task, folder = made[0], tmp_path / "set"
    monkeypatch.setattr("scenegen.rooms.make.RoomsWork", DyingRooms)
    monkeypatch.setenv("TRIED", str(tmp_path / "tried"))
    monkeypatch.setenv("DIES", "always")
    with pytest.raises(LostWorkerError) as lost:
        task.shards(folder, workers=2)
    assert lost.value.where.startswith("scenes 4 to 7:")
    assert lost.value.found == "signal 11, SIGSEGV"
    assert list(task.parts(folder)) == ["rooms-00000-of-00003.h5"]
    monkeypatch.setenv("DIES", "once")
    (tmp_path / "tried").unlink()
    task.shards(folder, workers=2)
    assert contents(folder) == contents(made[1])


@pytest.mark.parametrize("made", ["questions"], indirect=True)
def test_no_file_but_the_answers_tells_the_seed(made, tmp_path):
    task, known, _ = made
    with pytest.raises(StopError):
        task.shards(tmp_path / "part", secret=True, command="", progress=stopping(task.rows - 1))
    with pytest.raises(SpecError):
        task.shards(tmp_path / "part", secret=False)
    task.shards(tmp_path / "secret", secret=True, command="")
    for folder in (tmp_path / "secret", tmp_path / "part", known):
        for path in folder.rglob("*.*"):
            tells = path.is_file() and str(SEED).encode() in path.read_bytes()
            assert tells == (folder == known and path.match("iqtt-test-answers*")), path.name


HELD = """
import ctypes, sys
frames = []  # with all that functions had in their variables, until the end and beyond
ctypes.pythonapi.Py_IncRef(ctypes.py_object(frames))
sys.setprofile(lambda frame, event, argument: frames.append(frame))
import scenegen
try:
    with scenegen.open_rooms(sys.argv[1]) as rooms:
        print(rooms[3].depth.shape)
except scenegen.SceneGenError as error:
    print(error)
"""


@pytest.mark.parametrize("made", ["views"], indirect=True)
@pytest.mark.parametrize("shards", [pytest.param(2, marks=pytest.mark.slow), 1])
def test_what_is_held_to_the_end_does_not_crash_hdf5(copied, shards):
    """Python's own end does not free what a traceback or a cache holds; nor with a lost shard."""
    task, folder = copied
    files = sorted(folder.glob("*-of-*.h5"))
    if shards == 1:
        files[-1].unlink()
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[4])}
    command = [sys.executable, "-c", HELD, str(folder / task.files[0])]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert (files[-1].name in done.stdout) == (shards == 1)


RENDER = "render --n 60 --size 32 --min-visible-pixels 3 --shard-size 5 --seed 3 --out rooms.h5"
SLOWLY = """
import time, cli
from scenegen.files.sets import making
write = making.write_piece
def slowly(*arguments):
    time.sleep(0.2)  # so that signals come before the end
    return write(*arguments)
making.write_piece = slowly
cli.scenegen()
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="sends signals")
@pytest.mark.parametrize("workers", ["1", "2"])
def test_the_same_command_goes_on(run, tmp_path, monkeypatch, workers):
    """After SIGKILL, and then after SIGTERM, which is answered with how to go on."""
    command = [*RENDER.split(), "--workers", workers]
    monkeypatch.setattr(sys, "argv", ["scenegen", *command])  # is recorded
    home, done = parts_folder(tmp_path / "rooms.h5"), {}
    for number in (signal.SIGKILL, signal.SIGTERM):
        process = subprocess.Popen(
            [sys.executable, "-c", SLOWLY, *command], cwd=tmp_path,
            stderr=subprocess.PIPE, text=True,
        )  # fmt: skip
        deadline = time.monotonic() + 60
        while len(complete_parts(home)) <= len(done) and time.monotonic() < deadline:
            time.sleep(0.01)
        process.send_signal(number)
        _, message = process.communicate(timeout=30)
        assert process.returncode == (143 if number == signal.SIGTERM else -number), message
        assert not contents(tmp_path)
        now = {p.stem: p.stat().st_mtime_ns for p in complete_parts(home).values()}
        assert now.items() >= done.items(), "complete shards are kept"
        done = now
    assert f"{len(done)} shards are complete" in message
    assert [path.name for path in home.glob(".*")] == []
    assert run(*command).exit_code == 0
    assert {name: (tmp_path / name).stat().st_mtime_ns for name in done} == done
    assert hidden(tmp_path) == []
    unbroken = tmp_path / "unbroken"
    unbroken.mkdir()
    monkeypatch.chdir(unbroken)
    run(*command)
    assert contents(tmp_path) == contents(unbroken)
