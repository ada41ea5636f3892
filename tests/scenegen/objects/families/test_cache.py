"""The cache of members: hits, damaged files, folders that take nothing, several processes."""

import errno
import multiprocessing
import os
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest

from scenegen.common.errors import SpecError
from scenegen.objects.cast_meshes import CastMesh, cast_mesh
from scenegen.objects.families import cache
from scenegen.objects.families.cache import MemberCache, code_version
from scenegen.objects.families.members import make_member

MUG = ("mug", 7)


@pytest.fixture
def made(monkeypatch: pytest.MonkeyPatch) -> Mock:
    """Its `call_count` says how often a member was made, not read from the cache."""
    counted = Mock(wraps=make_member)
    monkeypatch.setattr(cache, "make_member", counted)
    return counted


def check(found: MemberCache, member: tuple[str, int] = MUG) -> None:
    shape = make_member(*member)
    outline, faces = found.outline(*member)
    assert (outline.name, faces) == (shape.name, len(shape.triangles))
    for name in ("hull_points", "hull_discs", "resting_directions", "rounding", "is_sphere"):
        np.testing.assert_array_equal(getattr(outline, name), getattr(shape, name))
    mesh, expected = found.mesh(*member), cast_mesh(shape)
    for name in vars(expected):
        np.testing.assert_array_equal(getattr(mesh, name), getattr(expected, name))


def only_file(folder: Path) -> Path:
    (path,) = (path for path in folder.rglob("*") if path.is_file())
    return path


def test_a_member_is_made_once_and_comes_back_as_it_was(tmp_path: Path, made: Mock) -> None:
    folder = tmp_path / "new" / "cache"
    check(MemberCache(folder))
    check(MemberCache(folder))
    assert made.call_count == 1
    assert only_file(folder) == folder / f"members-{code_version()}" / "mug-0007.bin"


def test_without_a_folder_only_the_last_meshes_are_kept(
    made: Mock, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = MemberCache()
    check(found)
    found.mesh(*MUG)
    assert made.call_count == 1, "the outline has the mesh made"
    monkeypatch.setattr(cache, "MOST_FACES_KEPT", 1)
    found.mesh("bowl", 1)
    found.mesh(*MUG)
    assert made.call_count == 3


@pytest.mark.parametrize("member", [("cup", 1), ("mug", -1), ("mug", 1000), ("../mug", 1)])
def test_unknown_members_are_refused(member: tuple[str, int], tmp_path: Path) -> None:
    for ask in (MemberCache(tmp_path).outline, MemberCache(tmp_path).mesh):
        with pytest.raises(SpecError):
            ask(*member)
    assert list(tmp_path.iterdir()) == []


def flip(place: int) -> Callable[[bytes], bytes]:
    def damage(data: bytes) -> bytes:
        some = bytearray(data)
        some[place] ^= 1
        return bytes(some)

    return damage


@pytest.mark.parametrize(
    "damage",
    [
        lambda data: b"",
        lambda data: data[:9],
        lambda data: data[:300],
        lambda data: data[:-1],
        lambda data: data + b"x",
        lambda data: bytes(len(data)),
        lambda data: b"\xff" * len(data),
        *(flip(place) for place in (0, 2, 4, 7, 8, 12, 16, 200, 5000, -1)),
    ],
)
def test_a_damaged_file_is_made_again(
    damage: Callable[[bytes], bytes], tmp_path: Path, made: Mock
) -> None:
    MemberCache(tmp_path).mesh(*MUG)
    path = only_file(tmp_path)
    data = path.read_bytes()
    path.write_bytes(damage(data))
    check(MemberCache(tmp_path))
    assert made.call_count == 2
    assert path.read_bytes() == data


def test_what_is_no_file_is_passed_over(tmp_path: Path) -> None:
    found = MemberCache(tmp_path)
    assert found.folder
    (found.folder / "mug-0007.bin").mkdir(parents=True)
    with pytest.warns(UserWarning, match="--cache-dir"):
        check(found)


def test_other_code_has_a_folder_of_its_own(
    tmp_path: Path, made: Mock, monkeypatch: pytest.MonkeyPatch
) -> None:
    MemberCache(tmp_path).mesh(*MUG)
    monkeypatch.setattr(np, "__version__", "0.0")
    code_version.cache_clear()
    try:
        MemberCache(tmp_path).mesh(*MUG)
    finally:
        code_version.cache_clear()
    assert made.call_count == 2
    assert len(list(tmp_path.iterdir())) == 2


def test_the_version_depends_on_all_that_makes_members(monkeypatch: pytest.MonkeyPatch) -> None:
    read, seen = Path.read_bytes, list[str]()

    def noted(path: Path) -> bytes:
        seen.append(path.name)
        return read(path)

    monkeypatch.setattr(Path, "read_bytes", noted)
    code_version.__wrapped__()
    assert {"vessels.py", "members.py", "sweeps.py", "solids.py", "cast_meshes.py"} < set(seen)


@pytest.mark.parametrize("place", ["a file", "below a file", "full", "read only"])
def test_a_folder_that_takes_nothing_costs_one_warning(
    place: str, tmp_path: Path, made: Mock, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "file"
    file.write_text("")
    folder = {"a file": file, "below a file": file / "x"}.get(place, tmp_path / "cache")
    MemberCache(tmp_path / "cache").mesh("bowl", 3)
    if place in ("full", "read only"):
        number = errno.ENOSPC if place == "full" else errno.EROFS
        failing = Mock(side_effect=OSError(number, os.strerror(number)))
        monkeypatch.setattr(Path, "write_bytes", failing)
    found = MemberCache(folder)
    with pytest.warns(UserWarning, match="--cache-dir"):
        check(found)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check(found, ("mug", 8))
        before = made.call_count
        check(found, ("bowl", 3))
    assert made.call_count == before + (folder == file or folder == file / "x") * 1, "still read"
    assert sorted(p.name for p in tmp_path.rglob("*.bin")) == ["bowl-0003.bin"], "and no leftovers"


def fill(folder: Path, start: Any) -> None:
    start.wait()
    for number in range(6):
        MemberCache(folder).mesh("table", number)


def test_several_processes_fill_one_folder(tmp_path: Path) -> None:
    context = multiprocessing.get_context("spawn")
    start = context.Barrier(3)
    workers = [context.Process(target=fill, args=(tmp_path, start)) for _ in range(3)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join(120)
        assert worker.exitcode == 0
    found = MemberCache(tmp_path)
    assert found.folder
    assert len(list(found.folder.iterdir())) == 6
    for number in range(6):
        check(found, ("table", number))


def test_arrays_are_single_precision_and_cannot_be_changed_by_mistake(tmp_path: Path) -> None:
    MemberCache(tmp_path).mesh(*MUG)
    mesh: CastMesh = MemberCache(tmp_path).mesh(*MUG)
    assert {mesh.triangles.dtype.name, mesh.normals.dtype.name} == {"float32"}
    assert not mesh.triangles.flags.writeable
