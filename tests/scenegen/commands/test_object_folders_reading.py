"""`verify` and `export` on files of models: with their folder, with another one, with none."""

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import trimesh
from object_folders import Run, models_of, render


@pytest.mark.parametrize("views", ["0", "0,40"])
def test_a_file_is_verified_with_its_folder(
    run: Run, verdict: Any, meshes: Path, views: str
) -> None:
    render(run, "--objects-root", meshes, "--views", views, count=4)
    folder = ("--objects-root", meshes, "--cache-dir", "cache")
    code, checks, output = verdict("rooms.h5", *folder)
    assert code == 0, output
    assert set(checks.values()) == {"ok"}
    moved = meshes.rename(meshes.with_name("moved"))
    assert verdict("rooms.h5", "--objects-root", moved, "--cache-dir", "new")[0] == 0


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
    words = ("other", "holds other models than the file was made from")
    refuses("verify", "rooms.h5", "--objects-root", other, *cache, words=words)
    words = ("holds other models",)
    refuses("verify", "rooms.h5", "--objects-root", meshes, "--up", "z", *cache, words=words)
    shutil.rmtree(other / "mug")
    refuses("verify", "rooms.h5", "--objects-root", other, *cache, words=("mug",))


@pytest.mark.parametrize("how", ["other", "broken", "gone"])
def test_a_model_that_changed_since_is_found(
    run: Run, verdict: Any, meshes: Path, how: str
) -> None:
    """Under the same name: other content, nothing usable."""
    render(run, "--objects-root", meshes, count=6)
    path = meshes / "mug" / "tall.obj"
    assert "mug/tall" in models_of()
    if how == "other":
        trimesh.creation.box((1, 1, 1)).export(path)
    elif how == "broken":
        path.write_text("v 1 2 3")
    else:
        path.write_bytes(b"")
    code, checks, output = verdict("rooms.h5", "--objects-root", meshes, "--cache-dir", "cache")
    assert code == 1, output
    failed = {name for name, word in checks.items() if word == "FAIL"}
    assert failed == {"description", "drawn again from the seed", "rendered again"}


def test_meshes_are_exported_from_their_folder(run: Run, meshes: Path) -> None:
    """All corners of a room's objects, at their place; without the folder it is asked for."""
    render(run, "--objects-root", meshes, count=1)
    export = ("export", "rooms.h5", "--items", 0, "--format")
    told = ("--objects-root", meshes, "--cache-dir", "cache")
    assert run(*export, "obj", *told).exit_code == 0
    refused = run(*export, "obj", "--overwrite")
    assert refused.exit_code == 2
    assert "--objects-root" in refused.stderr
    assert run(*export, "exr").exit_code == 0, "which needs no mesh"
    scene = trimesh.load_mesh("rooms-000000.obj", process=False)
    with h5py.File("rooms.h5") as file:
        count = int(file["object/count"][0])
        places = file["object/world_from_object"][0, :count]
        scales = file["object/scale"][0, :count]
    for place, scale in zip(places, scales, strict=True):
        distance = np.linalg.norm(scene.vertices - place[:3, 3], axis=1)
        assert np.isclose(distance, scale, rtol=1e-5).any(), "a corner on the bounding sphere"


def test_built_in_objects_are_exported(run: Run) -> None:
    render(run, "--classes", "mug,chair", count=1)
    result = run("export", "rooms.h5", "--items", 0, "--format", "obj")
    assert result.exit_code == 0, result.output
    assert len(trimesh.load_mesh("rooms-000000.obj").faces) > 6


def test_a_folder_whose_files_have_changed_is_noticed(run: Run, meshes: Path) -> None:
    """By its names alone it would be the same; the room would be exported with another shape."""
    render(run, "--objects-root", meshes, "--classes", "bowl", count=3)
    told = ("--objects-root", meshes, "--cache-dir", "cache")
    trimesh.creation.icosphere(2).export(meshes / "bowl" / "ball.ply")
    trimesh.creation.icosphere(1).export(meshes / "bowl" / "cone.off")
    export = ("export", "rooms.h5", "--items", "0-2", "--format", "obj", "--out", "exports")
    exported = run(*export, *told)
    assert exported.exit_code == 2
    assert "row 0 was made from other files than the folder holds now: bowl/" in exported.stderr
    assert not Path("exports").exists(), "before anything is written"
    verified = run("verify", "rooms.h5", "--items", 0, *told)
    assert verified.exit_code == 1
    assert "made from other files than the folder's" in verified.stdout


def test_a_file_of_built_in_objects_needs_no_folder(run: Run, meshes: Path) -> None:
    assert run("render", "--n", 1, "--size", 24).exit_code == 0
    result = run("verify", "rooms.h5", "--objects-root", meshes)
    assert result.exit_code == 2
    assert "built in" in result.stderr


@pytest.mark.parametrize("command", ["verify", "export --items 0 --format obj",
                                     "export --items 0 --format exr"])  # fmt: skip
def test_folder_options_that_contradict_one_another_are_refused(
    run: Run, refuses: Callable[..., str], meshes: Path, shapenet: Path, command: str
) -> None:
    """As `render` refuses them; the file itself could be read with the first option alone."""
    name, *options = command.split()
    for root, more, words in (
        (("--shapenet-root", shapenet), ("--up", "z"), ("up: found 'z'", "--shapenet-root")),
        (("--shapenet-root", shapenet), ("--objects-root", meshes), ("expected one of them",)),
        (("--objects-root", meshes), ("--shapenet-root", shapenet), ("expected one of them",)),
        ((), ("--up", "z"), ("up: found 'z'", "--objects-root")),
    ):
        render(run, *(root or ("--objects-root", meshes)), "--overwrite", count=1)
        told = (*root, "--cache-dir", "cache")
        refuses(name, "rooms.h5", *options, *told, *more, words=words)
