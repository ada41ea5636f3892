"""Files that lead elsewhere, or take more than they say, are refused before anything is read."""

import errno
import itertools
import os
import pickle
import subprocess
import sys
import tracemalloc
import zlib
from unittest.mock import Mock

import h5py
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scenegen.common.errors import FileFormatError
from scenegen.files import input_file
from scenegen.files.input_file import StoredArray, faults, open_file, open_unchecked, reading

VALUES = np.random.default_rng(0).random((6, 5, 4)).astype("f4")


@pytest.fixture
def path(tmp_path):
    return tmp_path / "data.h5"


@pytest.fixture
def fifo(tmp_path):
    """Return a pipe that nobody writes to: whoever opens it waits for ever."""
    os.mkfifo(tmp_path / "fifo")
    return str(tmp_path / "fifo")


def virtual(file, source):
    layout = h5py.VirtualLayout((6, 5), "f4", maxshape=(None, 5))
    endless = h5py.h5s.UNLIMITED
    layout[0:endless, :] = h5py.VirtualSource(source, "x", (6, 5), maxshape=(None, 5))[0:endless, :]
    file.create_virtual_dataset("depth", layout)


ELSEWHERE = {
    "a soft link": lambda file, other: file.__setitem__("depth", h5py.SoftLink("/other")),
    "an external link": lambda f, other: f.__setitem__("depth", h5py.ExternalLink(other, "/x")),
    "a link in a group": lambda f, other: f.create_group("camera").__setitem__(
        "depth", h5py.ExternalLink(other, "/x")
    ),
    "external storage": lambda f, other: f.create_dataset(
        "depth", (4,), "f4", external=[(other, 0, 16)]
    ),
    "a virtual dataset": virtual,
}


@pytest.mark.parametrize("make", ELSEWHERE.values(), ids=ELSEWHERE.keys())
def test_nothing_leads_out_of_a_file(make, path, fifo):
    with h5py.File(path, "w") as file:
        make(file, fifo)
    with pytest.raises(FileFormatError) as error:
        open_file(path, "rooms file")
    assert error.value.where.endswith("depth")
    with h5py.File(path, "r+"):  # it was closed again
        pass


def stored(**options):
    return lambda file: file.create_dataset("depth", data=VALUES, **options)


@pytest.mark.parametrize(
    ("make", "rule"),
    [
        (lambda f: f.create_dataset("depth", (4, 9), "f4", chunks=(1, 9)), "written"),
        (lambda f: f.create_dataset("depth", (4, 9), "f4"), "written"),
        (stored(scaleoffset=2), "filters"),
        (stored(chunks=(6, 5, 4), compression="gzip", fletcher32=True), None),
        (stored(compression="lzf", shuffle=True), None),
        (lambda f: f.create_dataset("depth", (0, 4), "f4", maxshape=(None, 4)), None),
        (lambda f: f.create_dataset("depth", data=h5py.Empty("f4")), None),
        (lambda f: [f.create_group(f"g{i}") for i in range(11)], "count"),
        (lambda f: f.create_group("/g" * 1500), "count"),
        (lambda f: [f.attrs.__setitem__(f"a{i}", i) for i in range(6)], "attributes"),
    ],
)
def test_what_is_refused_before_a_value_is_read(make, rule, path, monkeypatch):
    monkeypatch.setattr(input_file, "MOST_OBJECTS", 10)
    monkeypatch.setattr(input_file, "MOST_ATTRIBUTES", 5)
    with h5py.File(path, "w") as file:
        make(file)
    with open_unchecked(path, "file") as file:
        assert [fault.rule for fault in faults(file)] == ([rule] if rule else [])


BOMB, SHORT = (zlib.compress(bytes(size)) for size in (30_000_000, 255))


@pytest.mark.parametrize(
    "options", [{}, {"compression": "gzip", "shuffle": True}, {"compression": "lzf"}], ids=str
)
@pytest.mark.parametrize(
    "payload", [BOMB, SHORT, bytes(10_000), b"x", b"", b"\xff\xff\x00" * 70_000], ids=len
)
def test_no_mask_of_filters_makes_room_for_other_bytes(path, options, payload):
    """Neither more than the chunk has, nor fewer: for these HDF5 gives what its memory held."""
    for rows, mask in itertools.product((1, 2000), range(4)):
        with h5py.File(path, "w") as file:
            shape = {"chunks": (rows, 8, 8), "maxshape": (None, 8, 8)}
            made = file.create_dataset("depth", (1, 8, 8), "f4", **shape, **options)
            if payload:
                made.id.write_direct_chunk((0, 0, 0), payload, mask)
        with open_unchecked(path, "rooms file") as file:
            if next(faults(file), None) is None:
                tracemalloc.start()
                with pytest.raises(FileFormatError), reading("depth"):
                    StoredArray(file["depth"])[0 if rows == 1 else ()]
                assert tracemalloc.get_traced_memory()[1] < 5e6
                tracemalloc.stop()


def test_chunks_that_cannot_be_compressed_and_texts_that_are(path):
    """HDF5 may leave a filter out of a chunk, and says so in its mask."""
    values = np.frombuffer(np.random.default_rng(0).bytes(2 * 64 * 4), "u4").reshape(2, 8, 8)
    with h5py.File(path, "w") as file:
        for name in ("gzip", "lzf"):
            file.create_dataset(name, data=values, chunks=(1, 8, 8), compression=name)
        texts = np.array(["long " * 50, "x"] * 8, object)
        file.create_dataset("scene", data=texts, dtype=h5py.string_dtype(), compression="gzip")
    with open_file(path, "file") as file:
        for name in ("gzip", "lzf"):
            assert np.array_equal(StoredArray(file[name])[1], values[1])
        assert StoredArray(file["scene"])[0] == texts[0].encode()


def test_a_stack_of_filters(path):
    """Each stage could multiply the size by a thousand."""
    with h5py.File(path, "w") as file:
        storage = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        storage.set_chunk((1, 8))
        storage.set_deflate(9)
        storage.set_deflate(9)
        space = h5py.h5s.create_simple((2, 8))
        made = h5py.h5d.create(file.id, b"depth", h5py.h5t.IEEE_F32LE, space, storage)
        made.write(h5py.h5s.ALL, h5py.h5s.ALL, np.ones((2, 8), "f4"))
    with open_unchecked(path, "file") as file:
        assert [fault.rule for fault in faults(file)] == ["filters"]


def forwards(rows):
    return (rows.step or 1) > 0


@settings(deadline=None, max_examples=60)
@given(
    chunks=st.tuples(st.integers(1, 6), st.integers(1, 5), st.integers(1, 4)),
    compression=st.sampled_from([None, "gzip", "lzf"]),
    shuffle=st.booleans(),
    fletcher32=st.booleans(),
    dtype=st.sampled_from(["<f4", ">f8", "i1", "<u2"]),
    rows=st.one_of(st.integers(-6, 5), st.slices(6).filter(forwards), st.just(())),
)
def test_values_are_those_that_h5py_reads(
    chunks, compression, shuffle, fletcher32, dtype, rows, tmp_path_factory
):
    path = tmp_path_factory.mktemp("stored") / "data.h5"
    with h5py.File(path, "w") as file:
        file.create_dataset(
            "depth", data=(VALUES * 100).astype(dtype), chunks=chunks, compression=compression,
            shuffle=shuffle, fletcher32=fletcher32,
        )  # fmt: skip
    with open_file(path, "file") as file:
        ours = StoredArray(file["depth"])
        found, expected = ours[rows], file["depth"][rows]
        assert (found.dtype, found.flags.writeable) == (expected.dtype, expected.flags.writeable)
        assert np.array_equal(found, expected)
        with pytest.raises(IndexError):
            ours[6]


def test_what_is_said_of_a_damaged_chunk_can_be_sent_to_another_process(path):
    """With its causes: libraries may pickle these too."""
    with h5py.File(path, "w") as file:
        chunks = file.create_dataset("x", data=VALUES, chunks=(1, 5, 4), compression="gzip")
        chunks.id.write_direct_chunk((2, 0, 0), b"not compressed")
    with open_file(path, "file") as file, pytest.raises(FileFormatError) as error, reading("x"):
        StoredArray(file["x"])[2]
    link = error.value
    while link is not None:
        pickle.dumps(type(link))
        link = link.__cause__ or link.__context__


@pytest.mark.parametrize("number", [errno.EAGAIN, errno.EACCES, errno.EIO, errno.ESTALE])
def test_errors_of_the_system_are_named_and_do_not_blame_the_file(path, monkeypatch, number):
    """As from a file that another process writes to, or a network disk that went away."""
    with h5py.File(path, "w") as file:
        file["depth"] = VALUES
    error = OSError(number, f"Unable to synchronously open file (errno = {number})")
    monkeypatch.setattr(h5py, "File", Mock(side_effect=error))
    with pytest.raises(OSError, match=r"\. ") as refused:
        open_file(path, "file of rooms")
    assert not isinstance(refused.value, FileFormatError)
    assert (refused.value.errno, refused.value.filename) == (number, str(path))
    assert str(number) not in refused.value.strerror
    with pytest.raises(OSError, match="row 3") as refused, reading("row 3"):
        raise error
    assert refused.value.errno == number


def test_a_file_held_by_a_writer_is_refused_as_such(path):
    code = f"import h5py; f = h5py.File({str(path)!r}, 'w'); f['x'] = 1; print(flush=True); input()"
    command = [sys.executable, "-c", code]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as writer:
        writer.stdout.readline()
        with pytest.raises(OSError) as refused:
            open_file(path, "file of rooms")
        writer.communicate(b"\n")
    assert refused.value.errno == errno.EAGAIN
