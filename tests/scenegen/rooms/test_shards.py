"""Rooms in shards: one set to every reader, the same bytes after a kill, and no wrong shard."""

import hashlib
import json
import os
import shutil
import signal
import subprocess
import sys
import time

import h5py
import numpy as np
import pytest
from verified import checks_of, checks_of_set

from scenegen.common.errors import FileFormatError, SceneGenError, SpecError
from scenegen.files.manifest import manifest_path, read_manifest
from scenegen.files.run_lock import run_lock
from scenegen.files.shards import ROW_DIGESTS, SHARDS
from scenegen.rooms.merge import merge_rooms
from scenegen.rooms.reader import RoomsFile

SCENES, SIZE = 11, 4
LAYOUTS = {"one view": {}, "two views": {"views": (0.0, 40.0)}}


@pytest.fixture(scope="module", params=LAYOUTS, ids=str)
def made(request, make_rooms, tmp_path_factory):
    """Return the same rooms as a set of three shards and as one file."""
    folder, how = tmp_path_factory.mktemp("set"), LAYOUTS[request.param]
    (folder / "one").mkdir()
    one = make_rooms(folder / "one" / "rooms.h5", SCENES, **how)
    path = make_rooms(folder / "rooms.h5", SCENES, {"shard_size": SIZE}, **how)
    return path, one


@pytest.fixture
def copied(made, tmp_path):
    """Return a copy of the set that a test may change."""
    for file in made[0].parent.glob("rooms*"):
        shutil.copy(file, tmp_path / file.name)
    return tmp_path / "rooms.h5"


def known(path):
    """Return the records of the shards that the manifest of a set knows; none without it."""
    place = manifest_path(path)
    return read_manifest(place).shards if place.exists() else ()


def contents(folder):
    return {p.name: p.read_bytes() for p in folder.glob("*.h5")}


def test_names_and_nothing_else(made):
    names = [f"rooms-0000{i}-of-00003.h5" for i in range(3)]
    found = sorted(p.name for p in made[0].parent.iterdir() if p.is_file())
    assert found == sorted([*names, "rooms.h5", "rooms.manifest.json"])


def test_plain_h5py_reads_the_set_as_one_file(made, copied, monkeypatch):
    """From any folder, and after all files were moved together."""
    monkeypatch.chdir("/")
    with h5py.File(copied) as file, h5py.File(made[1]) as one:
        names = []
        one.visititems(lambda name, item: names.append(name) if hasattr(item, "dtype") else None)
        for name in names:
            np.testing.assert_array_equal(file[name][()], one[name][()], err_msg=name)
            for key in set(one[name].attrs) - {"DIMENSION_LIST", "REFERENCE_LIST"}:
                value = one[name].attrs[key]
                np.testing.assert_array_equal(file[name].attrs[key], value, err_msg=f"{name} {key}")
        for key in set(one.attrs) - {"content_digest"}:
            assert file.attrs[key] == one.attrs[key], key


def test_our_reader_reads_it_as_one_file(made):
    with RoomsFile(made[0]) as rooms, RoomsFile(made[1]) as one:
        assert len(rooms) == len(one)
        assert (rooms.spec, rooms.fingerprint) == (one.spec, one.fingerprint)
        assert rooms.stored_digests() == one.stored_digests()
        assert rooms.stored_truth_digest == one.stored_truth_digest
        assert rooms.stored_bytes()["depth"] == one.stored_bytes()["depth"]
        for row in (0, 5, len(one) - 1, -1):
            np.testing.assert_array_equal(rooms[row].depth, one[row].depth)
            assert rooms[row].scene == one[row].scene
        for rows in (slice(None), slice(2, 9), slice(1, None, 3), slice(0, 0)):
            for name in ("scene_index", "object/model", "depth"):
                np.testing.assert_array_equal(rooms.read(name, rows), one.read(name, rows))
        with pytest.raises(IndexError):
            rooms.read("depth", len(one))


def test_merged_it_is_the_one_file(made, tmp_path):
    merge_rooms(made[0], tmp_path / "rooms.h5")
    assert (tmp_path / "rooms.h5").read_bytes() == made[1].read_bytes()


def test_a_set_verifies(made):
    for check in [*checks_of_set(made[0], 3), *checks_of(made[0], 3)]:
        assert check.ok, check


def test_row_digests_are_those_of_the_rows(made):
    with h5py.File(made[0].with_name("rooms-00001-of-00003.h5")) as file:
        names = list(file[ROW_DIGESTS].attrs["names"])
        for name in ("depth", "camera/world_from_camera"):
            expected = [hashlib.sha256(row.tobytes()).digest() for row in file[name]]
            stored = file[ROW_DIGESTS][:, names.index(name)]
            assert [row.tobytes() for row in stored] == expected


def test_a_flipped_bit_is_named(copied):
    shard = copied.with_name("rooms-00001-of-00003.h5")
    data = bytearray(shard.read_bytes())
    data[len(data) // 2] ^= 4
    shard.write_bytes(data)
    (failed,) = [check for check in checks_of_set(copied) if not check.ok]
    assert (failed.name, shard.name in failed.detail) == ("checksums", True)


@pytest.mark.parametrize("stop", ["missing", "of another run", "renamed set", "list", "sources"])
def test_a_set_that_is_not_whole_is_refused(copied, make_rooms, stop):
    shard, path = copied.with_name("rooms-00001-of-00003.h5"), copied
    if stop == "missing":
        shard.unlink()
    elif stop == "of another run":
        with RoomsFile(copied) as rooms:
            views = rooms.spec.views
        other = copied.parent / "other"
        other.mkdir()
        make_rooms(other / "rooms.h5", SCENES, {"shard_size": SIZE}, views=views, seed=9)
        shutil.copy(other / shard.name, shard)
    elif stop == "renamed set":
        path = copied.rename(copied.with_name("rooms2.h5"))
    elif stop == "list":
        with h5py.File(copied, "r+") as file:
            line = json.loads(file[SHARDS][0]) | {"file": "../rooms-00000-of-00003.h5"}
            file[SHARDS][0] = json.dumps(line)
    else:
        with h5py.File(copied, "r+") as file:
            shape = file["depth"].shape
            del file["depth"]
            layout = h5py.VirtualLayout(shape, "f4")
            layout[:] = h5py.VirtualSource("/etc/passwd", "depth", shape)
            file.create_virtual_dataset("depth", layout)
    with pytest.raises(FileFormatError), RoomsFile(path) as rooms:
        [room.depth for room in rooms]


@pytest.mark.parametrize("left", [0, 1, 3])
def test_a_run_goes_on_where_it_stopped(make_rooms, tmp_path, made, left):
    """With some complete shards, of which the manifest lacks the first."""
    with RoomsFile(made[0]) as rooms:
        how = {"views": rooms.spec.views}
    path, done = tmp_path / "rooms.h5", []

    def stop(rows):
        done.append(rows)
        if left < 3 and len(list(tmp_path.glob("rooms-*.h5"))) > left:
            raise KeyboardInterrupt

    options = {"shard_size": SIZE, "batch": 4}
    if left < 3:
        with pytest.raises(KeyboardInterrupt):
            make_rooms(path, SCENES, {**options, "progress": stop}, **how)
        assert not path.exists()
        place = manifest_path(path)
        told = json.loads(place.read_text())
        place.write_text(json.dumps(told | {"shards": told["shards"][1:]}))
    kept = {shard.file: (tmp_path / shard.file).stat().st_mtime_ns for shard in known(path)}
    again = []
    make_rooms(path, SCENES, {**options, "progress": again.append}, **how)
    assert sum(again) == SCENES * len(how["views"])
    assert {name: (tmp_path / name).stat().st_mtime_ns for name in kept} == kept
    assert contents(tmp_path) == contents(made[0].parent)
    assert read_manifest(manifest_path(path)).complete
    assert not list(tmp_path.glob(".*"))


def test_a_shard_that_was_lost_or_damaged_is_made_again(copied, make_rooms, made):
    with RoomsFile(copied) as rooms:
        how = {"views": rooms.spec.views}
    copied.with_name("rooms-00002-of-00003.h5").write_bytes(b"x")
    copied.with_name("rooms-00000-of-00003.h5").unlink()
    make_rooms(copied, SCENES, {"shard_size": SIZE}, **how)
    assert contents(copied.parent) == contents(made[0].parent)


def test_other_options_are_refused_by_name(copied, make_rooms):
    with RoomsFile(copied) as rooms:
        how = {"views": rooms.spec.views}
    for options, settings, word in (
        ({"shard_size": 5}, {}, "shard-size"),
        ({"shard_size": SIZE}, {"seed": 99}, "seed"),
        ({"shard_size": SIZE, "compression": "none"}, {}, "compression"),
    ):
        with pytest.raises(SpecError) as refused:
            make_rooms(copied, SCENES, options, **{**how, **settings})
        assert word in refused.value.found
    with pytest.raises(FileExistsError):
        make_rooms(copied, SCENES, {"shard_size": SIZE}, **how)
    make_rooms(copied, 9, {"shard_size": 3, "overwrite": True}, **how)
    with RoomsFile(copied) as rooms:
        assert len(rooms) == 9 * len(rooms.spec.views)
    assert len(list(copied.parent.glob("rooms-*-of-00003.h5"))) == 3


@pytest.mark.parametrize("name", ["../rooms.h5", "", "a/b", ".."])
@pytest.mark.parametrize("which", ["set", "shard"])
def test_a_manifest_names_only_files_beside_it(copied, name, which):
    told = json.loads(manifest_path(copied).read_text())
    if which == "set":
        told["files"] = [name]
    else:
        told["shards"][1]["file"] = name
    manifest_path(copied).write_text(json.dumps(told))
    with pytest.raises(FileFormatError):
        checks_of_set(copied)


@pytest.mark.parametrize(
    "wrong",
    [
        {"files": []}, {"spec": "[]"}, {"spec": "{"}, {"count": 0}, {"count": 10**30},
        {"count": 4 * 10**9}, {"shards": []}, {"shard_size": -1}, {"format": "2"},
    ],
    ids=str,
)  # fmt: skip
def test_no_manifest_is_believed(copied, wrong):
    told = json.loads(manifest_path(copied).read_text())
    manifest_path(copied).write_text(json.dumps(told | wrong))
    try:
        checks = checks_of_set(copied, 0)
    except FileFormatError:
        return
    assert not all(check.ok for check in checks)


@pytest.mark.parametrize("order", [[1, 0, 2], [0, 0, 2]], ids=str)
def test_rows_are_shown_in_their_order_or_not_at_all(copied, order):
    """Plain h5py would read other rows than our readers."""
    with h5py.File(copied, "r+") as file:
        old = file["depth"].virtual_sources()
        shape, layout = file["depth"].shape, h5py.VirtualLayout(file["depth"].shape, "f4")
        place = 0
        for number in order:
            first, last = (bounds[0] for bounds in old[number].vspace.get_select_bounds())
            rows = min(last - first + 1, shape[0] - place)
            layout[place : place + rows] = h5py.VirtualSource(
                old[number].file_name, "depth", (rows, *shape[1:])
            )
            place += rows
        del file["depth"]
        file.create_virtual_dataset("depth", layout)
    with pytest.raises(FileFormatError):
        RoomsFile(copied)


def test_a_whole_file_and_a_set_replace_each_other_only_when_told(copied, make_rooms):
    with RoomsFile(copied) as rooms:
        how = {"views": rooms.spec.views}
    copied.unlink()  # as if the run had been killed
    with pytest.raises(FileExistsError):
        make_rooms(copied, 2, **how)
    make_rooms(copied, 2, {"overwrite": True}, **how)
    assert [path.name for path in copied.parent.iterdir()] == ["rooms.h5"]
    with pytest.raises(FileExistsError):
        make_rooms(copied, SCENES, {"shard_size": SIZE}, **how)
    make_rooms(copied, SCENES, {"shard_size": SIZE, "overwrite": True}, **how)
    for overwrite in (False, True):
        other = {"shard_size": SIZE, "overwrite": overwrite}
        with pytest.raises(SpecError):
            make_rooms(copied.with_suffix(".hdf5"), SCENES, other, **how)


def test_files_of_others_are_kept(tmp_path, make_rooms):
    (tmp_path / "rooms-00001-of-00003.h5").write_text("mine")
    with pytest.raises(FileExistsError):
        make_rooms(tmp_path / "rooms.h5", SCENES, {"shard_size": SIZE})
    assert (tmp_path / "rooms-00001-of-00003.h5").read_text() == "mine"


def test_two_runs_never_make_one_set(tmp_path, make_rooms):
    place = manifest_path(tmp_path / "rooms.h5")
    lock = place.with_name(f".{place.name}.lock")
    with run_lock(lock, place), pytest.raises(SceneGenError) as refused:
        make_rooms(tmp_path / "rooms.h5", SCENES, {"shard_size": SIZE})
    assert "another run" in refused.value.found
    assert list(tmp_path.iterdir()) == []


RENDER = "render --n 400 --size 32 --min-visible-pixels 3 --shard-size 50 --seed 3 --out rooms.h5"
COMMAND = [sys.executable, "-c", "import cli; cli.scenegen()", *RENDER.split(), "--workers"]
ENVIRONMENT = {**os.environ, "OMP_NUM_THREADS": "1"}


@pytest.fixture(scope="module")
def unbroken(tmp_path_factory):
    """Return what a run makes that nothing stops, in one process."""
    folder = tmp_path_factory.mktemp("unbroken")
    subprocess.run([*COMMAND, "1"], cwd=folder, env=ENVIRONMENT, check=True)
    return contents(folder)


@pytest.mark.skipif(sys.platform == "win32", reason="sends signals")
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
def test_the_same_command_goes_on(tmp_path, number, unbroken):
    """After a kill at some moment; SIGTERM is answered with how to go on."""
    process = subprocess.Popen(
        [*COMMAND, "2"], cwd=tmp_path, env=ENVIRONMENT, stderr=subprocess.PIPE, text=True
    )
    deadline = time.monotonic() + 60
    while not list(tmp_path.glob("rooms-*.h5")) and time.monotonic() < deadline:
        time.sleep(0.01)
    path = tmp_path / "rooms.h5"
    process.send_signal(number)
    _, said = process.communicate(timeout=10)
    if number == signal.SIGTERM:
        assert process.returncode == 128 + number
        assert "the same command goes on" in said
        assert not list(tmp_path.glob(".*"))
    assert not (tmp_path / "rooms.h5").exists()
    done = {p: p.stat().st_mtime_ns for p in (tmp_path / one.file for one in known(path))}
    assert len(done) >= len(list(tmp_path.glob("rooms-*.h5"))) - 1  # of that moment
    subprocess.run([*COMMAND, "1"], cwd=tmp_path, env=ENVIRONMENT, check=True)
    assert {p: p.stat().st_mtime_ns for p in done} == done, "complete shards are kept"
    assert not [p for p in tmp_path.iterdir() if p.name.startswith(".")]
    assert contents(tmp_path) == unbroken
