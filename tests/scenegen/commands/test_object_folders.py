"""`scenegen render`, `verify` and `export` with folders of meshes, some of them broken."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
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


def test_the_same_bytes_with_and_without_the_cache_and_in_any_batch(run: Run, meshes: Path) -> None:
    for name, options in (
        ("a", ()),
        ("b", ("--cache-dir", "other", "--batch", 1)),
    ):
        result = run("render", "--n", 6, *SMALL, "--objects-root", meshes, *options, "--out", name)
        assert result.exit_code == 0, result.output
    with h5py.File("a") as a, h5py.File("b") as b:
        for name in ("image", "depth", "normal", "object_id", "scene"):
            np.testing.assert_array_equal(a[name][:], b[name][:])


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


def test_classes_that_a_folder_lacks_are_refused(
    refuses: Callable[..., str], meshes: Path, shapenet: Path
) -> None:
    render_one = ("render", "--n", 1, *SMALL)
    refuses(*render_one, "--objects-root", meshes, "--classes", "mug,plane", words=("plane",))
    refuses(*render_one, "--shapenet-root", shapenet, "--classes", "sofa", words=("sofa",))
    refuses(*render_one, "--objects-root", meshes, "--classes", "", words=("class",))


@pytest.mark.parametrize("least", [0, 1])
def test_scenes_of_models_may_be_without_objects(
    run: Run, verdict: Any, meshes: Path, least: int
) -> None:
    render(run, "--objects-root", meshes, "--objects", f"0-{least}", "--batch", 1, count=4)
    assert verdict("rooms.h5", "--objects-root", meshes, "--cache-dir", "cache")[0] == 0


@pytest.mark.parametrize("options", ["--objects 0", "--objects 0-1 --batch 1"])
def test_built_in_families_need_no_folder(run: Run, verdict: Any, options: str) -> None:
    render(run, "--preset", "shapenet", *options.split(), count=3)
    assert verdict("rooms.h5")[0] == 0
    assert run("info", "rooms.h5").exit_code == 0
    assert run("preview", "rooms.h5").exit_code == 0
    assert run("export", "rooms.h5", "--items", 0, "--format", "obj").exit_code == 0


def test_a_file_is_verified_with_its_folder(run: Run, verdict: Any, meshes: Path) -> None:
    render(run, "--objects-root", meshes, "--views", "0,40", count=3)
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


def test_folder_options_that_contradict_one_another_are_refused(
    run: Run, refuses: Callable[..., str], meshes: Path, shapenet: Path
) -> None:
    """As `render` refuses them; the file itself could be read with the first option alone."""
    for root, more, words in (
        (("--shapenet-root", shapenet), ("--up", "z"), ("up: found 'z'", "--shapenet-root")),
        (("--shapenet-root", shapenet), ("--objects-root", meshes), ("expected one of them",)),
        (("--objects-root", meshes), ("--shapenet-root", shapenet), ("expected one of them",)),
        ((), ("--up", "z"), ("up: found 'z'", "--objects-root")),
    ):
        render(run, *(root or ("--objects-root", meshes)), "--overwrite", count=1)
        options = (*root, "--cache-dir", "cache", *more)
        refuses("verify", "rooms.h5", *options, words=words)
        for form in ("obj", "exr"):
            how = ("--items", 0, "--format", form)
            refuses("export", "rooms.h5", *how, *options, words=words)
