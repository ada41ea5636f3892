"""The reader of rows and its data set, for rooms and for questions, whole and in shards."""

import json
import os
import pickle
import shutil
import subprocess
import sys

import h5py
import numpy as np
import pytest

from iqtt import QuestionsDataset, QuestionsFile
from iqtt.files.make import make_split
from iqtt.questions.specs import SplitSpec
from scenegen import RoomsDataset, RoomsFile
from scenegen.common.errors import FileFormatError, SpecError
from scenegen.files.content import dataset_digest, joint_digest
from scenegen.files.sets.shards import SHARDS, OpenFile

TASKS = ("rooms", "questions")
IMAGES = {"rooms": "image", "questions": "questions"}
NUMBERS = {"rooms": "camera/fov_y_degrees", "questions": "angle_degrees"}
READERS = {"rooms": RoomsFile, "questions": QuestionsFile}
DATASETS = {"rooms": RoomsDataset, "questions": QuestionsDataset}
# Reads a file in other processes, after it was read here.
PROCESSES = """
import multiprocessing, sys, warnings
warnings.simplefilter("ignore", DeprecationWarning)  # 3.12 on: forking a process with threads
if sys.argv[1] == "rooms":
    from scenegen import RoomsDataset as Dataset
else:
    from iqtt import QuestionsDataset as Dataset

def total(i):
    return int(data[i][data.fields[0]].sum())

def from_pickle(pair):
    copy, i = pair
    return int(copy[i][copy.fields[0]].sum())

if __name__ == "__main__":
    data = Dataset(sys.argv[2])
    here = [total(i) for i in range(len(data))]
    with multiprocessing.get_context("fork").Pool(3) as pool:
        for _ in range(5):
            assert pool.map(total, range(len(data)), chunksize=1) == here, "fork"
    pairs = [(data, i) for i in range(len(data))]
    with multiprocessing.get_context("spawn").Pool(2) as pool:
        assert pool.map(from_pickle, pairs, chunksize=1) == here, "spawn"
    assert [total(i) for i in range(len(data))] == here, "here again"
    print("equal", len(set(here)))
"""


@pytest.fixture(scope="session")
def sets(make_rooms, tmp_path_factory):
    """Return for each task a file, and a set of shards with the same rows."""
    folder = tmp_path_factory.mktemp("sets")
    (folder / "one").mkdir()
    rooms = make_rooms(folder / "one" / "rooms.h5", 7)
    in_shards = make_rooms(folder / "rooms.h5", 7, {"shard_size": 3})
    spec = SplitSpec(seed=5, train=0, labeled=0, val=7, test=0, height=32, width=32,
                     cubes=(5, 7), min_cube_pixels=2)  # fmt: skip
    for name, size in (("whole", 100), ("shards", 3)):
        make_split(folder / name, spec, command="tests", shard_size=size)
    questions = (folder / "whole" / "iqtt-val.h5", folder / "shards" / "iqtt-val.h5")
    return {"rooms": (rooms, in_shards), "questions": questions}


@pytest.fixture(params=TASKS)
def task(request):
    return request.param


@pytest.fixture
def whole(sets, task):
    return sets[task][0]


@pytest.fixture
def copied(sets, task, tmp_path):
    """Return a copy of the set that a test may change."""
    path = sets[task][1]
    for file in path.parent.glob(f"{path.stem}*"):
        if file.is_file():
            shutil.copy(file, tmp_path / file.name)
    return tmp_path / path.name


def test_rows_and_indices(whole, task):
    with READERS[task](whole) as file, h5py.File(whole) as raw:
        stored = raw[IMAGES[task]][()]
        assert len(file) == len(stored) == 7
        for row, record in enumerate(file):
            np.testing.assert_array_equal(file.read(IMAGES[task], row), stored[row])
            assert record.index == row
        for rows in (slice(None), slice(2, 5), slice(1, None, 3), slice(0, 0), -1):
            np.testing.assert_array_equal(file.read(IMAGES[task], rows), stored[rows])
        assert file[-1].index == file[6].index == 6
        for row in (7, -8, 10**12):
            with pytest.raises(IndexError):
                file[row]
            with pytest.raises(IndexError):
                file.read(NUMBERS[task], row)
        with pytest.raises(SpecError) as error:
            file.read("cube", 0)
        assert (error.value.where, error.value.found) == ("field", "'cube'")


def test_digests_are_those_of_the_values(whole, task):
    with READERS[task](whole) as file, h5py.File(whole) as raw:
        digests = file.stored_digests()
        assert set(digests) == set(file.fields)
        for name in file.fields:
            place, home = file.stored_at(name)
            assert place == whole
            assert digests[name] == raw[home].attrs["sha256"] == dataset_digest(raw[home])
        scored = {name: digests[name] for name in file.SCORED if name in digests}
        assert file.stored_truth_digest == joint_digest(scored) == raw.attrs["truth_digest"]
        assert file.problems() == []
        assert file.compression() == "gzip"


def test_a_set_reads_as_one_file(sets, task):
    path, in_shards = sets[task]
    with READERS[task](in_shards) as rows, READERS[task](path) as one:
        assert len(rows) == len(one)
        assert rows.fields == one.fields
        assert (rows.spec, rows.fingerprint) == (one.spec, one.fingerprint)
        assert rows.stored_digests() == one.stored_digests()
        assert rows.stored_truth_digest == one.stored_truth_digest
        assert rows.stored_bytes()[IMAGES[task]] == one.stored_bytes()[IMAGES[task]]
        assert rows.compression() == one.compression()
        assert [count for _, count in rows.parts] == [3, 3, 1]
        assert one.parts == [(path, 7)]
        for rows_read in (slice(None), slice(2, 6), slice(1, None, 3), slice(0, 0), 0, 5, -1):
            for name in rows.fields:
                values, expected = rows.read(name, rows_read), one.read(name, rows_read)
                np.testing.assert_array_equal(values, expected)
        with pytest.raises(IndexError):
            rows.read(IMAGES[task], len(one))


def another_run(path, sets, task):
    """Put a shard of another run in the place of one."""
    with h5py.File(next(path.parent.glob("*-00001-of-*")), "r+") as file:
        file.attrs["content_digest"] = "0" * 64


def without_a_shard(path, sets, task):
    next(path.parent.glob("*-00001-of-*")).unlink()


def renamed(path, sets, task):
    return path.rename(path.with_name("other.h5"))


def listing_elsewhere(path, sets, task):
    with h5py.File(path, "r+") as file:
        line = json.loads(file[SHARDS][0])
        file[SHARDS][0] = json.dumps(line | {"file": f"../{line['file']}"})


def showing(order, source=None):
    """Show the images of the shards in another order, or of another file."""

    def edit(path, sets, task):
        name = IMAGES[task]
        with h5py.File(path, "r+") as file:
            shape, kind, old = file[name].shape, file[name].dtype, file[name].virtual_sources()
            told = {k: v for k, v in file[name].attrs.items() if not k.startswith("DIMENSION")}
            layout, place = h5py.VirtualLayout(shape, kind), 0
            for number in order:
                first, last = (bounds[0] for bounds in old[number].vspace.get_select_bounds())
                count = min(last - first + 1, shape[0] - place)
                shown = source or old[number].file_name
                layout[place : place + count] = h5py.VirtualSource(shown, name, (count, *shape[1:]))
                place += count
            del file[name]
            file.create_virtual_dataset(name, layout).attrs.update(told)

    return edit


def a_list_that_is_virtual(path, sets, task):
    """Reading it would wait for a pipe."""
    os.mkfifo(path.with_name("pipe"))
    layout = h5py.VirtualLayout((1,), h5py.string_dtype())
    layout[:] = h5py.VirtualSource(str(path.with_name("pipe")), "x", (1,))
    with h5py.File(path, "r+") as file:
        del file[SHARDS]
        file.create_virtual_dataset(SHARDS, layout)


WRONG_SETS = {
    "a shard is missing": without_a_shard,
    "a shard of another run": another_run,
    "the set was renamed": renamed,
    "the list leads to another folder": listing_elsewhere,
    "the list leads to another file": a_list_that_is_virtual,
    "rows of another file": showing([0, 1, 2], "/etc/passwd"),
    "rows in another order": showing([1, 0, 2]),
    "rows twice": showing([0, 0, 2]),
}


@pytest.mark.parametrize("wrong", WRONG_SETS)
def test_a_set_that_is_not_what_was_made_is_refused(copied, sets, task, wrong):
    path = WRONG_SETS[wrong](copied, sets, task) or copied
    with pytest.raises(FileFormatError), READERS[task](path) as file:
        file.read(IMAGES[task], slice(None))


def test_items_of_a_data_set(whole, task):
    data = DATASETS[task](whole)
    with READERS[task](whole) as file:
        assert (data.spec, data.fingerprint, len(data)) == (file.spec, file.fingerprint, 7)
        for row in (0, 6, -1):
            item = data[row]
            assert list(item) == list(data.fields)
            for name, values in item.items():
                np.testing.assert_array_equal(values, file.read(name, row))
    for row in (7, -8):
        with pytest.raises(IndexError):
            data[row]
    assert sum(1 for _ in data) == 7, "the old iteration protocol ends at IndexError"
    chosen = DATASETS[task](whole, fields=(NUMBERS[task],))
    assert list(chosen[2]) == [NUMBERS[task]]
    with pytest.raises(SpecError) as error:
        DATASETS[task](whole, fields=(NUMBERS[task], "depht"))
    assert (error.value.where, error.value.found) == ("field", "'depht'")


@pytest.fixture
def openings(monkeypatch):
    """Return the list of processes that open a file from now on, one for each time."""
    processes, opened = [], OpenFile.__init__

    def counting(self, *arguments):
        processes.append(os.getpid())
        opened(self, *arguments)

    monkeypatch.setattr(OpenFile, "__init__", counting)
    return processes


def test_an_open_file_is_not_opened_again(whole, task, openings):
    """Until it is closed: then the data set opens it for itself."""
    with READERS[task](whole) as file:
        data = DATASETS[task](file)
        first, again = data[0], pickle.loads(pickle.dumps(data))
        assert len(openings) == 1
    np.testing.assert_array_equal(data[0][IMAGES[task]], first[IMAGES[task]])
    np.testing.assert_array_equal(again[0][IMAGES[task]], first[IMAGES[task]])
    assert len(openings) == 3


@pytest.mark.parametrize(
    "task", ["rooms", pytest.param("questions", marks=pytest.mark.slow)], indirect=True
)
def test_reading_in_several_processes(sets, task, tmp_path):
    script = tmp_path / "read.py"
    script.write_text(PROCESSES)
    command = [sys.executable, str(script), task, str(sets[task][1])]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert done.stdout == "equal 7\n", done.stderr


@pytest.mark.parametrize("as_index", [list, tuple, np.array])
def test_rows_are_chosen_as_numpy_does(whole, task, as_index):
    """By slices, lists and arrays of numbers or of truth values; what is no index says so."""
    data = DATASETS[task](whole, fields=(NUMBERS[task],))
    every = np.stack([item[NUMBERS[task]] for item in data])
    choose = [True] + [False] * (len(data) - 2) + [True]
    for index in (slice(0, 2), slice(None, None, -2), [2, 0, -1], choose):
        given = index if isinstance(index, slice) else as_index(index)
        np.testing.assert_array_equal(data[given][NUMBERS[task]], every[index])
    assert data[5:5][NUMBERS[task]].shape == (0, *every.shape[1:])
    with READERS[task](whole) as rows:
        assert [row.index for row in rows[1:3]] == [1, 2]
        assert [row.index for row in rows[as_index([2, 0])]] == [2, 0]
        for reader in (rows, data):
            for wrong in ([0.5], [99], [True], ["0"], [[0]]):
                with pytest.raises(IndexError):
                    reader[as_index(wrong)]
            for wrong in ("0", 1.0, None, True, np.True_):
                with pytest.raises(TypeError):
                    reader[wrong]


@pytest.mark.parametrize("task", ["rooms"])
def test_a_file_replaced_by_another_is_noticed(copied, task):
    """By workers, which open it for themselves."""
    data = pickle.dumps(RoomsDataset(copied))
    assert len(pickle.loads(data)[0]) == 4
    with h5py.File(copied, "r+") as file:
        file.attrs["content_digest"] = "0" * 64
    with pytest.raises(FileFormatError, match="replaced"):
        pickle.loads(data)[0]


def test_a_link_to_the_file_of_a_set_reads_the_set(sets, task, tmp_path):
    path = sets[task][1]
    (tmp_path / "link.h5").symlink_to(path)
    data, linked = DATASETS[task](path), DATASETS[task](tmp_path / "link.h5")
    np.testing.assert_array_equal(linked[3][IMAGES[task]], data[3][IMAGES[task]])
