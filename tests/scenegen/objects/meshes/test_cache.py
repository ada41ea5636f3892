"""The cache of cleaned models: hits, damaged entries, and several processes at once."""

import multiprocessing
import subprocess
import sys
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest
import trimesh

from scenegen.objects.meshes import cache
from scenegen.objects.meshes.cache import CachedModel, MeshCache, content_hash, default_cache_dir
from scenegen.objects.meshes.errors import BadMeshError

BALL = trimesh.creation.icosphere(subdivisions=2)


@pytest.fixture
def ball(tmp_path: Path) -> Path:
    path = tmp_path / "ball.ply"
    path.write_bytes(BALL.export(file_type="ply"))
    return path


@pytest.fixture
def made(monkeypatch: pytest.MonkeyPatch) -> Mock:
    """Its `call_count` says how often a model was cleaned, not read from the cache."""
    counted = Mock(wraps=cache.make_model)
    monkeypatch.setattr(cache, "make_model", counted)
    return counted


def same(one: CachedModel, two: CachedModel) -> None:
    for name in ("vertices", "faces", "hull_points"):
        a, b = getattr(one, name), getattr(two, name)
        assert a.dtype == b.dtype
        np.testing.assert_array_equal(a, b)
    assert dict(one.mended) == dict(two.mended)
    assert one.refusal == two.refusal


def test_a_model_is_cleaned_once(ball: Path, tmp_path: Path, made: Mock) -> None:
    folder = tmp_path / "new" / "cache"
    digest, fresh = MeshCache(folder).load(ball, "y")
    again, found = MeshCache(folder).load(ball, "y")
    assert made.call_count == 1
    assert digest == again == content_hash(ball.read_bytes(), ".ply", "y")
    same(fresh, found)
    assert [path.name for path in folder.iterdir()] == [f"{digest}.npz"]
    same(fresh, MeshCache(None).load(ball, "y")[1])
    assert made.call_count == 2


def test_what_a_model_was_made_from_is_in_its_name(
    ball: Path, tmp_path: Path, made: Mock, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The key depends on up axis, suffix, content and cleaning version, but not on the path."""
    store = MeshCache(tmp_path / "cache")
    store.load(ball, "y")
    copy = tmp_path / "copy.PLY"
    copy.write_bytes(ball.read_bytes())
    store.load(copy, "y")
    assert made.call_count == 1
    store.load(ball, "z")
    ball.write_bytes(ball.read_bytes() + b"\0")
    store.load(ball, "y")
    monkeypatch.setattr(cache, "CLEANING_VERSION", cache.CLEANING_VERSION + 1)
    store.load(ball, "y")
    assert made.call_count == 4
    assert content_hash(b"", ".obj", "y") != content_hash(b"", ".off", "y")


def test_damaged_entries_are_made_again(ball: Path, tmp_path: Path, made: Mock) -> None:
    """Entries may be cut short or have one bit flipped anywhere."""
    store = MeshCache(tmp_path / "cache")
    digest, fresh = store.load(ball, "y")
    entry = tmp_path / "cache" / f"{digest}.npz"
    whole = entry.read_bytes()
    cut = [whole[:length] for length in (0, 1, 30, len(whole) // 2, len(whole) - 1)]
    places = range(60, len(whole) - 60, len(whole) // 40)
    bits = [whole[:at] + bytes([whole[at] ^ 64]) + whole[at + 1 :] for at in places]
    for damaged in (*cut, *bits, b"nonsense", bytes(len(whole))):
        entry.write_bytes(damaged)
        same(store.load(ball, "y")[1], fresh)
        same(MeshCache(tmp_path / "cache").load(ball, "y")[1], fresh)
    assert made.call_count > 30
    assert entry.read_bytes() == whole


def test_entries_of_another_kind_are_made_again(ball: Path, tmp_path: Path, made: Mock) -> None:
    """Readable files with wrong content; none may run code."""
    store = MeshCache(tmp_path / "cache")
    digest, fresh = store.load(ball, "y")
    entry = tmp_path / "cache" / f"{digest}.npz"
    with np.load(entry) as arrays:
        good = dict(arrays)
    changes: list[dict[str, Any]] = [
        {"vertices": good["vertices"].astype(float)}, {"vertices": good["vertices"][:5]},
        {"faces": good["faces"][:, :2]}, {"faces": good["faces"] - 1}, {"faces": good["faces"][:0]},
        {"about": np.frombuffer(b"[]", np.uint8)}, {"about": np.frombuffer(b"{}", np.uint8)},
        {"hull_points": np.array([object()])},
    ]  # fmt: skip
    for i, change in enumerate(changes):
        np.savez(entry, **(good | change))
        same(store.load(ball, "y")[1], fresh)
        assert made.call_count == i + 2


def test_refusals_are_kept_with_their_reasons(tmp_path: Path, made: Mock) -> None:
    bad = tmp_path / "bad.obj"
    bad.write_text("v 0 0 0\n")
    reasons = set()
    for _ in range(3):
        with pytest.raises(BadMeshError) as refused:
            MeshCache(tmp_path / "cache").load(bad, "y")
        reasons.add(str(refused.value))
    assert made.call_count == 1
    assert len(reasons) == 1
    with pytest.raises(BadMeshError):
        MeshCache(tmp_path / "cache").load(tmp_path / "none.obj", "y")
    assert len(list((tmp_path / "cache").iterdir())) == 1


@pytest.mark.parametrize(
    ("error", "where"), [(MemoryError(), "model"), (np.linalg.LinAlgError("odd"), "cleaning")]
)
def test_errors_that_are_not_the_file_s_are_not_cached(
    error: Exception, where: str, ball: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as patch:
        patch.setattr(cache, "clean_mesh", Mock(side_effect=error))
        with pytest.raises(BadMeshError) as refused:
            MeshCache(tmp_path / "cache").load(ball, "y")
    assert refused.value.where == where
    assert str(error) in refused.value.found
    MeshCache(tmp_path / "cache").load(ball, "y")


@pytest.mark.parametrize("place", ["a file", "below a file", "full"])
def test_a_folder_that_takes_nothing_costs_one_warning(
    place: str, ball: Path, tmp_path: Path, made: Mock, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = {"a file": ball, "below a file": ball / "x", "full": tmp_path / "cache"}[place]
    if place == "full":
        monkeypatch.setattr(np, "savez", Mock(side_effect=OSError(28, "No space left on device")))
    store = MeshCache(folder)
    with pytest.warns(UserWarning, match="--cache-dir"):
        _, model = store.load(ball, "y")
    assert len(model.faces) == 320
    store.load(ball, "y")
    assert made.call_count == 2
    assert place != "full" or list(folder.iterdir()) == []


def fill(folder: Path, paths: list[Path], start: Any) -> None:
    start.wait()
    for path in paths:
        MeshCache(folder).load(path, "y")


def test_several_processes_fill_one_folder(tmp_path: Path) -> None:
    paths = [tmp_path / f"{i}.ply" for i in range(12)]
    for i, path in enumerate(paths):
        path.write_bytes(trimesh.creation.icosphere(3, 1 + i).export(file_type="ply"))
    context = multiprocessing.get_context("spawn")
    start = context.Barrier(4)
    folder = tmp_path / "cache"
    workers = [context.Process(target=fill, args=(folder, paths, start)) for _ in range(4)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join(60)
        assert worker.exitcode == 0
    assert len(list(folder.iterdir())) == 12, "and no leftovers"
    for path in paths:
        same(MeshCache(folder).load(path, "y")[1], MeshCache(None).load(path, "y")[1])


def test_a_killed_process_leaves_no_entry_that_is_not_whole(ball: Path, tmp_path: Path) -> None:
    code = f"""
import os, numpy
from pathlib import Path
from scenegen.objects.meshes.cache import MeshCache
write = numpy.savez
def dies(file, **arrays):
    write(file, **arrays)
    os._exit(9)
numpy.savez = dies
MeshCache({str(tmp_path / "cache")!r}).load(Path({str(ball)!r}), "y")
"""
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 9
    assert list((tmp_path / "cache").glob("*.npz")) == []
    with pytest.warns(UserWarning, match="partial"):
        assert len(MeshCache(tmp_path / "cache").load(ball, "y")[1].faces) == 320
    assert len(list((tmp_path / "cache").iterdir())) == 1


def test_where_the_cache_lies(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert default_cache_dir() == tmp_path / "pix2shape-bench" / "meshes"
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    for unset in ("", "not/absolute"):
        monkeypatch.setenv("XDG_CACHE_HOME", unset)
        assert default_cache_dir() == tmp_path / "home/.cache/pix2shape-bench/meshes"
    assert list(tmp_path.iterdir()) == [], "nothing is made before it is needed"
