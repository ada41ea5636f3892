"""`scenegen render` on folders of meshes, some of them broken."""

import json
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
    assert len(result.stdout.splitlines()) == 1
    (note,) = result.stderr.splitlines()
    assert note.startswith("note: mug/broken was passed over: ")
    used = set(models_of())
    assert used == {"mug/tall", "mug/round", "bowl/ball", "bowl/cone"}


def test_rows_name_class_and_model_and_the_file_behind(run: Run, meshes: Path) -> None:
    render(run, "--objects-root", meshes)
    with h5py.File("rooms.h5") as file:
        names = list(file["object/shape"].attrs["names"])
        spec = json.loads(file.attrs["spec"])
        shape, model, count = (file[f"object/{n}"][:] for n in ("shape", "model", "count"))
        scenes = [json.loads(text) for text in file["scene"][:]]
    assert names == spec["shapes"] == ["bowl", "mug"]
    assert spec["source"] == "folder"
    assert spec["listing"]
    digests: dict[str, set[str]] = {}
    for row, scene in enumerate(scenes):
        items = scene["objects"]
        assert [item["shape"].encode() for item in items] == model[row, : count[row]].tolist()
        assert [names[i] for i in shape[row, : count[row]]] == [
            item["shape"].split("/")[0] for item in items
        ]
        assert (shape[row, count[row] :] == -1).all()
        for item in items:
            digests.setdefault(item["shape"], set()).add(item["mesh"])
    assert all(len(some) == 1 for some in digests.values())
    assert len(set.union(*digests.values())) == len(digests) == 4


def test_the_same_bytes_with_and_without_the_cache_and_in_any_batch(run: Run, meshes: Path) -> None:
    for name, options in (
        ("a", ()),
        ("b", ("--batch", 1)),
        ("c", ("--cache-dir", "other", "--batch", 5)),
    ):
        result = run("render", "--n", 9, *SMALL, "--objects-root", meshes, *options, "--out", name)
        assert result.exit_code == 0, result.output
    with h5py.File("a") as a, h5py.File("b") as b, h5py.File("c") as c:
        for name in ("image", "depth", "normal", "object_id", "scene"):
            for other in (b, c):
                np.testing.assert_array_equal(a[name][:], other[name][:])


def test_a_folder_with_nothing_usable_is_refused_in_one_line(run: Run, tmp_path: Path) -> None:
    for name in ("mug", "bowl"):
        (tmp_path / "bad" / name).mkdir(parents=True)
        for i in range(2):
            (tmp_path / "bad" / name / f"{i}.obj").write_text("nothing of use")
    result = run("render", "--n", 2, *SMALL, "--objects-root", "bad")
    assert result.exit_code == 2
    assert result.stdout == ""
    (line,) = result.stderr.splitlines()
    assert line.startswith("Error: classes: ")
    assert "cannot be used, the last one since" in line
    assert "check-objects" in line
    assert not (tmp_path / "rooms.h5").exists()


def test_a_class_of_one_broken_model_is_refused_likewise(run: Run, meshes: Path) -> None:
    for name in ("tall.obj", "round.stl"):
        (meshes / "mug" / name).unlink()
    result = run("render", "--n", 2, *SMALL, "--objects-root", meshes, "--classes", "mug")
    assert result.exit_code == 2
    assert "models drawn from 'mug' cannot be used" in result.stderr
    assert len(result.stderr.splitlines()) == 1


def test_many_broken_models_are_told_of_in_a_few_lines(run: Run, meshes: Path) -> None:
    for i in range(30):
        (meshes / "mug" / f"bad{i}.obj").write_text("")
    lines = render(run, "--objects-root", meshes, count=40).stderr.splitlines()
    assert len(lines) == 6
    assert all(line.startswith("note: mug/") for line in lines[:5])
    assert lines[5].startswith("note: and ")
    assert "check-objects" in lines[5]


def test_splits_of_a_folder_are_disjoint(run: Run, tmp_path: Path) -> None:
    (tmp_path / "many" / "block").mkdir(parents=True)
    for i in range(60):
        trimesh.creation.box((1, 1 + i / 60, 1)).export(tmp_path / "many" / "block" / f"{i}.stl")
    used = {}
    for split in ("train", "val", "test"):
        render(run, "--objects-root", "many", "--object-split", split, "--out", split, count=25)
        used[split] = set(models_of(split))
        assert used[split]
    assert not used["train"] & used["val"]
    assert not used["train"] & used["test"]
    assert not used["val"] & used["test"]
    result = run("verify", "val", "--objects-root", "many", "--cache-dir", "cache")
    assert result.exit_code == 0, result.output


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
    refuses(*render_one, "--shapenet-root", meshes, words=("found no ShapeNet", "--objects-root"))


@pytest.mark.parametrize("least", [0, 1])
def test_scenes_of_models_may_be_without_objects(
    run: Run, verdict: Any, meshes: Path, least: int
) -> None:
    render(run, "--objects-root", meshes, "--objects", f"0-{least}", "--batch", 1, count=4)
    assert verdict("rooms.h5", "--objects-root", meshes, "--cache-dir", "cache")[0] == 0


@pytest.mark.parametrize("options", ["--objects 2", "--objects 0", "--objects 0-1 --batch 1"])
def test_built_in_families_need_no_folder(run: Run, verdict: Any, options: str) -> None:
    render(run, "--preset", "shapenet", *options.split(), count=3)
    assert verdict("rooms.h5")[0] == 0
    assert run("info", "rooms.h5").exit_code == 0
    assert run("preview", "rooms.h5").exit_code == 0


def test_contradictions_about_folders_are_refused(run: Run, meshes: Path, shapenet: Path) -> None:
    twice = run("render", "--n", 1, *SMALL, "--objects-root", meshes, "--classes", "mug,mug")
    assert twice.exit_code == 2
    assert "each name once" in twice.stderr
    up = run("render", "--n", 1, *SMALL, "--shapenet-root", shapenet, "--up", "z")
    assert up.exit_code == 2
    assert "expected 'y' with --shapenet-root" in up.stderr


@pytest.mark.parametrize(
    ("options", "found"),
    [
        (("--up", "z"), "without a folder of meshes"),
        (("--shading", "path", "--no-shadows"), "shadows: found with shading 'path'"),
        (("--shininess", 32), "shininess: found no specular"),
    ],
)
def test_options_that_would_do_nothing_are_refused(
    run: Run, options: tuple[object, ...], found: str
) -> None:
    result = run("render", "--n", 1, "--size", 24, *options)
    assert result.exit_code == 2
    assert found in result.stderr
    assert not Path("rooms.h5").exists()
