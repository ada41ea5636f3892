"""The reading API as a training loop uses it: indices, pickles, processes, loaders."""

import pickle
import subprocess
import sys

import numpy as np
import pytest

from scenegen import RoomsDataset, open_rooms
from scenegen.common.errors import FileFormatError, SpecError

# Reads a file in other processes, after it was read here; prints the sum each of them found.
PROCESSES = """
import multiprocessing, sys, warnings
from scenegen import RoomsDataset
warnings.simplefilter("ignore", DeprecationWarning)  # 3.12 on: forking a process with threads

def total(i):
    return float(data[i]["depth"].sum()) if "data" in globals() else None

def from_pickle(pair):
    rooms, i = pair
    return float(rooms[i]["depth"].sum())

if __name__ == "__main__":
    data = RoomsDataset(sys.argv[1])
    here = [total(i) for i in range(len(data))]
    with multiprocessing.get_context("fork").Pool(3) as pool:
        for _ in range(5):
            assert pool.map(total, range(len(data)), chunksize=1) == here, "fork"
    pairs = [(data, i) for i in range(len(data))]
    with multiprocessing.get_context("spawn").Pool(2) as pool:
        assert pool.map(from_pickle, pairs, chunksize=1) == here, "spawn"
    assert [total(i) for i in range(len(data))] == here, "here again"
    print("equal")
"""


def test_indices(rooms_path):
    with open_rooms(rooms_path) as rooms:
        assert len(rooms) == 8
        assert rooms[-1].index == rooms[7].index == 7
        np.testing.assert_array_equal(rooms[-8].depth, rooms[0].depth)
        assert not np.array_equal(rooms[0].depth, rooms[1].depth, equal_nan=True)
        for index in (8, -9, 10**12):
            with pytest.raises(IndexError):
                rooms[index]
        assert [room.index for room in rooms] == list(range(8))
        assert rooms.scene(3) == rooms[3].scene


def test_closing(rooms_path):
    rooms = open_rooms(rooms_path)
    rooms.close()
    rooms.close()
    with pytest.raises((FileFormatError, ValueError)):
        rooms[0]


def test_map_style_dataset(rooms_path):
    data = RoomsDataset(rooms_path, fields=("image", "camera/fov_y_degrees", "light/position"))
    assert len(data) == 8
    item = data[-2]
    assert list(item) == ["image", "camera/fov_y_degrees", "light/position"]
    with open_rooms(rooms_path) as rooms:
        np.testing.assert_array_equal(item["image"], rooms[6].image)
        assert data.fingerprint == rooms.fingerprint
        assert data.spec == rooms.spec
    for index in (8, -9):
        with pytest.raises(IndexError):
            data[index]
    assert sum(1 for _ in data) == 8, "the old iteration protocol ends at IndexError"


def test_unknown_fields_are_named(rooms_path):
    for fields in (("image", "depht"), ("scene",)):
        with pytest.raises(SpecError) as caught:
            RoomsDataset(rooms_path, fields=fields)
        assert caught.value.found == repr(fields[-1])
        assert "image, depth" in caught.value.expected


def test_pickling_after_reading(rooms_path):
    data = RoomsDataset(rooms_path)
    first = data[0]
    again = pickle.loads(pickle.dumps(data))
    for name, values in again[0].items():
        np.testing.assert_array_equal(values, first[name])
    assert again.fingerprint == data.fingerprint


def test_reading_in_several_processes(rooms_path, tmp_path):
    script = tmp_path / "read.py"
    script.write_text(PROCESSES)
    command = [sys.executable, str(script), str(rooms_path)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert done.stdout == "equal\n", done.stderr


@pytest.mark.slow
def test_torch_loader_with_workers(rooms_path):
    torch = pytest.importorskip("torch")
    data = RoomsDataset(rooms_path)
    data[0]  # open here, before the workers are forked
    loader = torch.utils.data.DataLoader(data, batch_size=3, num_workers=2)
    depth = torch.cat([batch["depth"] for batch in loader])
    with open_rooms(rooms_path) as rooms:
        np.testing.assert_array_equal(depth.numpy(), np.stack([room.depth for room in rooms]))
