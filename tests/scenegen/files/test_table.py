"""Compressed chunks: as HDF5 reads them, and the same bytes in every process and thread."""

import threading
import zlib

import h5py
import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from scenegen.files.table import deflated, shuffle_bytes


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
