"""The cache on disk: damage, full disks, kills, several processes."""

import json
import multiprocessing
import os
import struct
import subprocess
import sys
import warnings
import zlib
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest

from scenegen.objects.cache import DiskCache

NAMES = ("points", "text")
ARRAYS = {"points": np.arange(3000.0).reshape(-1, 3), "text": np.array("a text")}


def same(arrays):
    return arrays is not None and all(np.array_equal(arrays[n], ARRAYS[n]) for n in NAMES)


def test_an_entry_comes_back_as_it_was(tmp_path):
    folder = tmp_path / "new" / "cache"
    DiskCache(folder).write("key", ARRAYS)
    assert same(DiskCache(folder).read("key", NAMES))
    assert DiskCache(folder).read("other", NAMES) is None
    assert DiskCache(folder).read("key", ("points",)).keys() == {"points"}
    first = (folder / "key.arrays").read_bytes()
    DiskCache(folder).write("key", ARRAYS)
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == {"key.arrays": first}


def test_damaged_entries_count_as_missing(tmp_path):
    """Entries may be cut short, have one bit flipped anywhere, or hold something else."""
    disk, path = DiskCache(tmp_path), tmp_path / "key.arrays"
    disk.write("key", ARRAYS)
    whole = path.read_bytes()
    cut = [whole[:length] for length in (0, 1, 30, len(whole) // 2, len(whole) - 1)]
    places = range(60, len(whole) - 60, len(whole) // 200)
    flipped = [whole[:at] + bytes([whole[at] ^ 64]) + whole[at + 1 :] for at in places]
    missing = 0
    for damaged in (*cut, *flipped, b"nonsense", bytes(len(whole))):
        path.write_bytes(damaged)
        arrays = disk.read("key", NAMES)
        missing += arrays is None
        assert arrays is None or same(arrays), "a flipped bit that says nothing"
    assert missing > 190
    path.unlink()
    path.mkdir()
    assert disk.read("key", NAMES) is None


@pytest.mark.parametrize("kind", ["O", "no such", ""])
def test_entries_without_a_name_or_of_other_kinds_count_as_missing(
    kind: str, tmp_path: Path
) -> None:
    disk = DiskCache(tmp_path)
    disk.write("key", {"points": ARRAYS["points"]})
    assert disk.read("key", NAMES) is None
    header = json.dumps({name: [kind, [1], 0, zlib.crc32(bytes(16))] for name in NAMES}).encode()
    head = struct.pack("<2I", len(header), zlib.crc32(header))
    (tmp_path / "key.arrays").write_bytes(head + header + bytes(16))
    assert disk.read("key", NAMES) is None


@pytest.mark.parametrize("place", ["a file", "below a file", "full"])
def test_a_folder_that_takes_nothing_costs_one_warning(place, tmp_path, monkeypatch):
    file = tmp_path / "file"
    file.write_text("")
    folder = {"a file": file, "below a file": file / "x"}.get(place, tmp_path / "cache")
    DiskCache(tmp_path / "cache").write("old", ARRAYS)
    if place == "full":
        full = Mock(side_effect=OSError(28, "No space left on device"))
        monkeypatch.setattr(Path, "write_bytes", full)
    disk = DiskCache(folder)
    with pytest.warns(UserWarning, match="--cache-dir"):
        disk.write("key", ARRAYS)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        disk.write("key", ARRAYS)
        disk.check_folder()
    assert disk.read("key", NAMES) is None
    assert same(disk.read("old", NAMES)) == (place == "full"), "it is still read"
    assert [path.name for path in (tmp_path / "cache").iterdir()] == ["old.arrays"]


def test_a_folder_that_is_too_large_loses_its_oldest_entries(tmp_path):
    DiskCache(tmp_path).write("0", ARRAYS)
    size = (tmp_path / "0.arrays").stat().st_size
    (tmp_path / "mine.txt").write_text("mine")
    disk = DiskCache(tmp_path, 4 * size)
    for number in range(8):
        disk.write(f"{number}", ARRAYS)
        os.utime(tmp_path / f"{number}.arrays", (number, number))
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {"4.arrays", "5.arrays", "6.arrays", "7.arrays", "mine.txt"}


def fill(folder, start):
    start.wait()
    for number in range(12):
        DiskCache(folder).write(f"{number}", ARRAYS)
        assert same(DiskCache(folder).read(f"{number}", NAMES))


def test_several_processes_fill_one_folder(tmp_path):
    context = multiprocessing.get_context("spawn")
    start = context.Barrier(3)
    workers = [context.Process(target=fill, args=(tmp_path / "c", start)) for _ in range(3)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join(60)
        assert worker.exitcode == 0
    assert len(list((tmp_path / "c").iterdir())) == 12, "and no leftovers"


def test_a_killed_process_leaves_no_entry_that_is_not_whole(tmp_path):
    code = f"""
import os, pathlib, numpy
from scenegen.objects.cache import DiskCache
write = pathlib.Path.write_bytes
def dies(path, data):
    write(path, data)
    os._exit(9)
pathlib.Path.write_bytes = dies
DiskCache({str(tmp_path)!r}).write("key", {{"points": numpy.zeros(3)}})
"""
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 9
    (left,) = tmp_path.iterdir()
    assert DiskCache(tmp_path).read("key", NAMES) is None
    DiskCache(tmp_path).write("key", ARRAYS)
    assert same(DiskCache(tmp_path).read("key", NAMES))
    assert {path.name for path in tmp_path.iterdir()} == {left.name, "key.arrays"}
