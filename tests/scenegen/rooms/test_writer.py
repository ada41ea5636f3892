"""Nothing half-written ever carries the final name, whatever goes wrong."""

import os
import threading
import zlib

import h5py
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenegen.common.errors import SpecError
from scenegen.description.specs import DatasetSpec
from scenegen.files.table import deflated, shuffle_bytes
from scenegen.rooms.render import render_items
from scenegen.rooms.writer import create_rooms

SPEC = DatasetSpec(height=32, width=32, min_visible_pixels=3, seed=3)


@pytest.fixture(scope="module")
def rows():
    """Return 4 rendered rooms, as `append` takes them."""
    return [room for part in render_items(SPEC, range(4), 4) for room in part]


def test_only_a_complete_file_gets_the_final_name(tmp_path, rows):
    path = tmp_path / "x.h5"
    with create_rooms(path, SPEC, 4) as writer:
        assert not path.exists()
        writer.append(rows)
        assert not path.exists()
        assert len(list(tmp_path.iterdir())) == 1
    assert [p.name for p in tmp_path.iterdir()] == ["x.h5"]


def test_too_few_rows_make_no_file(tmp_path, rows):
    with (
        pytest.raises(RuntimeError, match="got 4 of 5 rows"),
        create_rooms(tmp_path / "x.h5", SPEC, 5) as writer,
    ):
        writer.append(rows)
    assert list(tmp_path.iterdir()) == []


def test_a_file_that_appears_meanwhile_is_kept(tmp_path, rows):
    path = tmp_path / "x.h5"
    with pytest.raises(FileExistsError):
        write_and_then(lambda: path.write_text("someone else's"), path, rows)
    assert path.read_text() == "someone else's"
    assert list(tmp_path.iterdir()) == [path]


def test_overwrite_replaces_only_when_complete(tmp_path, rows):
    path = tmp_path / "x.h5"
    path.write_text("old")
    with pytest.raises(ZeroDivisionError):
        write_and_then(lambda: 1 / 0, path, rows, overwrite=True)
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path], "the temporary file is removed"
    with create_rooms(path, SPEC, 4, overwrite=True) as writer:
        writer.append(rows)
        assert path.read_text() == "old"
    with h5py.File(path) as file:
        assert file["image"].shape == (4, 32, 32, 3)


def test_something_that_is_no_regular_file_is_never_replaced(tmp_path):
    """As /dev/null would be, by a rename as root."""
    path = tmp_path / "pipe"
    os.mkfifo(path)
    with pytest.raises(OSError, match="file"), create_rooms(path, SPEC, 4, overwrite=True):
        pass
    assert path.is_fifo()
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(("count", "compression"), [(0, "gzip"), (-1, "gzip"), (1, "zip")])
def test_bad_settings(tmp_path, count, compression):
    with pytest.raises(SpecError):
        create_rooms(tmp_path / "x.h5", SPEC, count, compression=compression).__enter__()
    assert list(tmp_path.iterdir()) == []


@given(
    st.binary(min_size=0, max_size=48).map(lambda data: data * 8),
    st.sampled_from(["uint8", "int16", "float32", "float64"]),
)
def test_shuffle_is_that_of_hdf5(data, dtype):
    values = np.frombuffer(data or bytes(8), "uint8").view(dtype)
    with h5py.File("shuffled", "w", driver="core", backing_store=False) as file:
        dataset = file.create_dataset("x", values.shape, dtype, chunks=values.shape, shuffle=True)
        dataset.id.write_direct_chunk((0,), shuffle_bytes(values).tobytes())
        assert dataset[...].tobytes() == values.tobytes()


@given(st.binary(min_size=0, max_size=200), st.integers(1, 9))
def test_deflated_is_a_zlib_stream(data, times):
    values = np.frombuffer(data * times, np.uint8)
    assert zlib.decompress(deflated(values)) == values.tobytes()


def test_deflated_does_not_depend_on_where_the_stack_lies():
    """ISA-L's own `compress` gives two outputs for some of these."""
    rng = np.random.default_rng(0)
    arrays = [np.frombuffer(rng.bytes(48) * 8, np.uint8) for _ in range(200)]
    expected, wrong = [deflated(array) for array in arrays], []

    def again():
        ready.wait()  # all threads live at once, so that no two have one stack
        wrong.extend(i for i, a in enumerate(arrays) if deflated(a) != expected[i])

    ready = threading.Barrier(150)
    threads = [threading.Thread(target=again) for _ in range(150)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert wrong == []


def write_and_then(happens, path, rows, overwrite=False):
    with create_rooms(path, SPEC, 4, overwrite=overwrite) as writer:
        writer.append(rows)
        happens()
