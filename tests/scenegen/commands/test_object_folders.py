"""`scenegen render`, `verify` and `export` with folders of meshes, some of them broken."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import pytest
import trimesh
from object_folders import SMALL, Run, models_of, render


def test_a_broken_model_is_passed_over_and_told_of(run: Run, meshes: Path) -> None:
    result = render(run, "--objects-root", meshes, count=20)
    assert result.stdout.startswith("rooms.h5: 20 images, ")
    assert len(result.stdout.splitlines()) == 2, "images, and how much of them is saturated"
    note, _ = result.stderr.splitlines()  # the other is on the axis of .stl files
    assert note.startswith("note: mug/broken was passed over: ")
    used = set(models_of())
    assert used == {"mug/tall", "mug/round", "bowl/ball", "bowl/cone"}


def test_a_folder_with_nothing_usable_is_refused(refuses: Callable[..., str], meshes: Path) -> None:
    for path in meshes.glob("*/*.*"):
        path.write_text("nothing of use")
    render_two = ("render", "--n", 2, *SMALL[:-2], "--objects-root", meshes)
    refuses(*render_two, words=("classes", "check-objects"))


def test_presets_take_their_classes_from_a_folder_that_has_them(
    run: Run, meshes: Path, shapenet: Path
) -> None:
    render(run, "--preset", "shapenet-single", "--objects-root", meshes, "--objects", "1", count=3)
    assert {name.split("/")[0] for name in models_of()} <= {"mug", "bowl"}
    with h5py.File("rooms.h5") as file:
        assert set(json.loads(file.attrs["spec"])["shapes"]) == {"bowl", "mug"}
    (meshes / "chair").mkdir()
    trimesh.creation.box((1, 2, 3)).export(meshes / "chair" / "1.stl")
    for preset, expected in (("furniture-256", {"chair"}), ("shapenet", {"mug", "bowl"}),
                             ("shapes", {"mug", "bowl", "chair"})):  # fmt: skip
        render(run, "--preset", preset, "--objects-root", meshes, "--overwrite", count=2)
        with h5py.File("rooms.h5") as file:
            assert set(file["object/shape"].attrs["names"]) == expected
    render(run, "--shapenet-root", shapenet, "--classes", "mug", "--overwrite", count=3)
    with h5py.File("rooms.h5") as file:
        assert json.loads(file.attrs["spec"])["source"] == "shapenet-v2"
    assert {name.split("/")[0] for name in models_of()} == {"mug"}


def test_with_another_folder_or_none_it_is_refused(
    run: Run, refuses: Callable[..., str], meshes: Path, shapenet: Path
) -> None:
    render(run, "--objects-root", meshes, count=2)
    cache = ("--cache-dir", "cache")
    refuses("verify", "rooms.h5", words=("--objects-root",))
    refuses("verify", "rooms.h5", "--shapenet-root", shapenet, words=("--objects-root",))
    refuses("verify", "rooms.h5", "--objects-root", "nosuch", words=("nosuch", "no such folder"))
    other = shutil.copytree(meshes, meshes.with_name("other"))
    (other / "mug" / "round.stl").rename(other / "mug" / "renamed.stl")
    words = ("other", "other models than the file's")
    refuses("verify", "rooms.h5", "--objects-root", other, *cache, words=words)
    words = ("other models",)
    refuses("verify", "rooms.h5", "--objects-root", meshes, "--up", "z", *cache, words=words)
    shutil.rmtree(other / "mug")
    refuses("verify", "rooms.h5", "--objects-root", other, *cache, words=("mug",))


@pytest.mark.parametrize("how", ["other", "broken"])
def test_a_model_that_changed_since_is_found(
    run: Run, verdict: Any, meshes: Path, how: str
) -> None:
    """Under the same name: other content, nothing usable."""
    render(run, "--objects-root", meshes, count=6)
    path = meshes / "mug" / "tall.obj"
    assert "mug/tall" in models_of()
    if how == "other":
        trimesh.creation.box((1, 1, 1)).export(path)
    else:
        path.write_text("v 1 2 3")
    code, checks, output = verdict("rooms.h5", "--objects-root", meshes, "--cache-dir", "cache")
    assert code == 1, output
    failed = {name for name, word in checks.items() if word == "FAIL"}
    assert failed == {"description", "drawn again from the seed", "rendered again"}


def test_a_folder_whose_files_have_changed_is_noticed(run: Run, meshes: Path) -> None:
    """By its names alone it would be the same; the room would be exported with another shape."""
    render(run, "--objects-root", meshes, "--classes", "bowl", count=3)
    told = ("--objects-root", meshes, "--cache-dir", "cache")
    trimesh.creation.icosphere(2).export(meshes / "bowl" / "ball.ply")
    trimesh.creation.icosphere(1).export(meshes / "bowl" / "cone.off")
    export = ("export", "rooms.h5", "--items", "0-2", "--format", "obj", "--out", "exports")
    exported = run(*export, *told)
    assert exported.exit_code == 2
    assert "row 0: found models that changed in the folder: bowl/" in exported.stderr
    assert not Path("exports").exists(), "before anything is written"
    verified = run("verify", "rooms.h5", "--items", 0, *told)
    assert verified.exit_code == 1
    assert "made from other files than the folder's" in verified.stdout
