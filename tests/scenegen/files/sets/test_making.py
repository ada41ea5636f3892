"""Sets of rooms and of questions: one file to every reader, and the same bytes whatever happens."""

import hashlib
import json
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

from scenegen.common.errors import FileFormatError, SceneGenError, SpecError
from scenegen.files.sets.manifest import read_manifest, write_manifest
from scenegen.files.sets.shards import ROW_DIGESTS
from scenegen.files.sets.workspace import run_lock

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


def test_a_merge_of_changed_values_leaves_nothing(copied, tmp_path):
    task, folder = copied
    shard = task.read_manifest(folder).shards_of(task.files[0])[-1]
    with h5py.File(folder / shard.file, "r+") as file:
        data = file["image" if "image" in file else "unlabeled/questions"]
        data[0] = data[0] ^ 1
    with pytest.raises(FileFormatError):
        task.merge(folder / task.files[0], tmp_path / "merged.h5")
    assert not (tmp_path / "merged.h5").exists()


def test_a_manifest_lists_the_files_with_rows(made):
    task, shards, whole = made
    manifest = task.read_manifest(shards)
    listed = {record.file: (record.bytes, record.sha256) for record in manifest.shards}
    data = {name: (shards / name).read_bytes() for name in listed}
    assert listed == {n: (len(raw), hashlib.sha256(raw).hexdigest()) for n, raw in data.items()}
    assert {path.name for path in shards.iterdir()} == {*task.files, task.manifest, *listed}
    assert manifest.complete
    assert (whole / task.manifest).exists() == (len(task.files) > 1)


def test_row_digests_are_those_of_the_rows(made):
    task, folder, _ = made
    with h5py.File(folder / task.read_manifest(folder).shards[0].file) as file:
        for number, name in enumerate(file[ROW_DIGESTS].attrs["names"]):
            values = file[name][()]
            rows = [row.tobytes() for row in values]
            if values.dtype.kind == "S":  # each text and a zero byte
                texts = values.reshape(len(values), -1).tolist()
                rows = [b"".join(text + b"\0" for text in row) for row in texts]
            expected = [hashlib.sha256(row).digest() for row in rows]
            stored = file[ROW_DIGESTS][:, number]
            assert [row.tobytes() for row in stored] == expected, name


def test_a_damaged_or_lost_shard_is_named_and_made_again(copied, made):
    task, folder = copied
    assert all(check.ok for check in task.verify(folder))
    damaged, lost = (task.read_manifest(folder).shards[i].file for i in (1, -1))
    flip(folder / damaged)
    (wrong,) = [check for check in task.verify(folder) if not check.ok]
    assert (wrong.name, damaged in wrong.detail) == ("checksums", True)
    (folder / lost).unlink()
    task.shards(folder)
    assert contents(folder) == contents(made[1])


@pytest.mark.parametrize(
    ("made", "share"), [("views", 0.0), ("questions", 0.5), ("views", 1.0)], indirect=["made"]
)
def test_a_run_goes_on_where_it_stopped(made, tmp_path, share):
    """The manifest lacks a file that is complete, as after a kill at that moment."""
    task, folder = made[0], tmp_path / "set"
    with pytest.raises(StopError):
        task.shards(folder, progress=stopping(share * (task.rows - 1)))
    if not share:
        assert not list(tmp_path.rglob("*.*")), "nothing was complete"
    else:
        manifest = task.read_manifest(folder)
        assert not manifest.complete
        lacking = {**vars(manifest), "shards": manifest.shards[:-1]}
        write_manifest(folder / task.manifest, type(manifest)(**lacking))
    kept = {folder / r.file for r in task.read_manifest(folder).shards} if share else set()
    before = {path: path.stat().st_mtime_ns for path in kept}
    for other in ({"seed": 9}, {"shard_size": 5}, {"compression": "none"}) if kept else ():
        with pytest.raises(SpecError):
            task.shards(folder, **other)
    rows = []
    task.shards(folder, progress=rows.append)
    assert sum(rows) == task.rows
    assert {path: path.stat().st_mtime_ns for path in kept} == before
    assert contents(folder) == contents(made[1])
    assert hidden(folder) == []
    with pytest.raises(FileExistsError):
        task.shards(folder)


@pytest.mark.parametrize(
    "task", [TASKS["views"], pytest.param(TASKS["questions"], marks=pytest.mark.slow)], ids=TASK_IDS
)
def test_other_requests_are_refused_by_name_and_replace_only_when_told(task, tmp_path):
    folder = tmp_path / "set"
    task.shards(folder)
    before = contents(folder)
    for other, word in (
        ({"seed": 9}, "seed"),
        ({"shard_size": 5}, "shard-size"),
        ({"compression": "none"}, "compression"),
        ({"height": 40}, "height"),
        ({"shard_size": 100}, "shard-size"),
    ):
        with pytest.raises(SpecError) as refused:
            task.shards(folder, **other)
        assert word in refused.value.found
    assert contents(folder) == before
    task.make(folder, overwrite=True)
    whole = contents(folder)
    assert whole.keys() == set(task.files)
    with pytest.raises((FileExistsError, SpecError)):
        task.shards(folder)
    task.shards(folder, overwrite=True, seed=9)
    task.shards(folder, overwrite=True)
    assert contents(folder) == before
    (folder / task.manifest).write_text("{")
    with pytest.raises(FileFormatError):
        task.shards(folder)
    task.make(folder, overwrite=True)
    assert contents(folder) == whole


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
def test_two_runs_never_make_one_set(task, tmp_path):
    folder = tmp_path / "set"
    folder.mkdir()
    place = folder / task.manifest
    with run_lock(folder / f".{task.manifest}.lock", place), pytest.raises(SceneGenError):
        task.shards(folder)
    assert list(folder.iterdir()) == []


def test_a_manifest_of_other_files_is_never_replaced(tmp_path):
    task = TASKS["rooms"]
    task.shards(tmp_path)
    (tmp_path / "rooms.h5").rename(tmp_path / "rooms.hdf5")
    manifest = task.read_manifest(tmp_path)
    write_manifest(
        tmp_path / task.manifest, type(manifest)(**{**vars(manifest), "files": ("rooms.hdf5",)})
    )
    for overwrite in (False, True):
        for make in (task.make, task.shards):
            with pytest.raises(SpecError):
                make(tmp_path, overwrite=overwrite)


@BOTH
@pytest.mark.parametrize("options", [{"compression": "zip"}, {"shard_size": 0}], ids=str)
def test_bad_settings_leave_nothing(task, tmp_path, options):
    with pytest.raises(SpecError):
        task.shards(tmp_path / "set", **options)
    assert not list(tmp_path.rglob("*.*"))


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


@pytest.mark.parametrize("made", ["questions"], indirect=True)
def test_no_file_but_the_answers_tells_the_seed(made, tmp_path):
    task, known, _ = made
    task.shards(tmp_path / "secret", secret=True, command="")
    for folder in (tmp_path / "secret", known):
        for path in folder.iterdir():
            tells = str(SEED).encode() in path.read_bytes()
            assert tells == (folder == known and path.match("iqtt-test-answers*")), path.name
    with pytest.raises(SpecError):
        task.shards(tmp_path / "secret", secret=False)


@pytest.mark.parametrize("made", ["views"], indirect=True)
@pytest.mark.parametrize("name", ["../rooms.h5", "", "a/b", ".."])
def test_a_manifest_names_only_files_beside_it(copied, name):
    task, folder = copied
    stored = json.loads((folder / task.manifest).read_text())
    first, second, *others = stored["shards"]
    for wrong in ({"files": [name]}, {"shards": [first, second | {"file": name}, *others]}):
        (folder / task.manifest).write_text(json.dumps(stored | wrong))
        with pytest.raises(FileFormatError):
            task.read_manifest(folder)


@pytest.mark.parametrize("made", ["views"], indirect=True)
def test_no_manifest_is_believed(copied):
    task, folder = copied
    stored = json.loads((folder / task.manifest).read_text())
    for wrong in (
        {"files": []}, {"spec": "[]"}, {"spec": "{"}, {"count": 0}, {"count": 10**30},
        {"count": 4 * 10**9}, {"shards": []}, {"shard_size": -1}, {"format": "2"},
    ):  # fmt: skip
        (folder / task.manifest).write_text(json.dumps(stored | wrong))
        try:
            checks = task.verify(folder)
        except FileFormatError:
            continue
        assert not all(check.ok for check in checks), wrong


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
@pytest.mark.parametrize("shards", [2, 1])
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


@pytest.mark.skipif(sys.platform == "win32", reason="sends signals")
@pytest.mark.parametrize("workers", ["1", pytest.param("2", marks=pytest.mark.slow)])
def test_the_same_command_goes_on(run, tmp_path, monkeypatch, workers):
    """After SIGKILL, and then after SIGTERM, which is answered with how to go on."""
    command = [*RENDER.split(), "--workers", workers]
    monkeypatch.setattr(sys, "argv", ["scenegen", *command])  # is recorded
    done = {}
    for number in (signal.SIGKILL, signal.SIGTERM):
        before = len(list(tmp_path.glob("rooms-*.h5")))
        process = subprocess.Popen(
            [sys.executable, "-c", SLOWLY, *command], cwd=tmp_path,
            stderr=subprocess.PIPE, text=True,
        )  # fmt: skip
        deadline = time.monotonic() + 60
        while len(list(tmp_path.glob("rooms-*.h5"))) <= before and time.monotonic() < deadline:
            time.sleep(0.01)
        process.send_signal(number)
        _, message = process.communicate(timeout=30)
        assert process.returncode == (143 if number == signal.SIGTERM else -number), message
        assert not (tmp_path / "rooms.h5").exists()
        assert {path: path.stat().st_mtime_ns for path in done} == done, "complete shards are kept"
        records = read_manifest(tmp_path / "rooms.manifest.json").shards
        done = {p: p.stat().st_mtime_ns for p in (tmp_path / record.file for record in records)}
        assert len(done) >= len(list(tmp_path.glob("rooms-*.h5"))) - 1
    assert f"{len(done)} of 12 shards are complete" in message
    assert hidden(tmp_path) == []
    assert run(*command).exit_code == 0
    assert {path: path.stat().st_mtime_ns for path in done} == done
    assert hidden(tmp_path) == []
    unbroken = tmp_path / "unbroken"
    unbroken.mkdir()
    monkeypatch.chdir(unbroken)
    run(*command)
    assert contents(tmp_path) == contents(unbroken)
