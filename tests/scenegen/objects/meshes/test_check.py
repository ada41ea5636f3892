"""The check of a whole folder: its records, table and JSON; no model may stop it."""

import json
import os

import pytest
import trimesh

from scenegen.objects.meshes import check
from scenegen.objects.meshes.check import ModelCheck, check_models
from scenegen.objects.meshes.folders import open_objects
from scenegen.objects.meshes.listing import object_split

BOX = trimesh.creation.box()


@pytest.fixture
def root(tmp_path, monkeypatch):
    """Two classes: four good boxes, one with a double face, one empty file, one with no faces."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "xdg"))
    root = tmp_path / "models"
    for name in ("box/a", "box/b", "box/c", "caf\u00e9/d"):
        path = root / f"{name}.off"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(BOX.export(file_type="off"))
    (root / "caf\u00e9" / "d.off").write_text(
        trimesh.creation.box((1, 2, 3)).export(file_type="off")
    )
    double = trimesh.Trimesh(BOX.vertices, [*BOX.faces, BOX.faces[0]], process=False)
    (root / "box" / "double.off").write_text(double.export(file_type="off"))
    (root / "box" / "empty.obj").touch()
    (root / "caf\u00e9" / "points.obj").write_text("v 0 0 0\n")
    return root


def test_table_and_json(run, root, tmp_path):
    result = run("check-objects", root, "--json", "out.json", "--up", "z")
    assert result.exit_code == 0, result.output
    assert result.stdout.splitlines()[3].split() == ["total", "7", "5", "1", "2", "60"]
    told = json.loads((tmp_path / "out.json").read_text(encoding="utf-8"))
    assert (told["kind"], told["up"]) == ("folder", "z")
    assert told["digest"] == open_objects(root, up="z").digest()
    by_name = {model["name"]: model for model in told["models"]}
    names = [f"box/{i}" for i in ("a", "b", "c", "double", "empty")]
    assert list(by_name) == [*names, "caf\u00e9/d", "caf\u00e9/points"]
    assert by_name["box/double"]["mended"]["double_faces"] == 1
    refused = by_name["box/empty"]
    assert (refused["ok"], refused["faces"], refused["mended"]) == (False, 0, {})
    assert f"refused  box/empty: {refused['reason']}" in result.stdout
    assert len(list((tmp_path / "xdg/pix2shape-bench/meshes").iterdir())) == 4, "equal files: one"


def test_equal_files_in_two_splits_are_an_error(run, refuses, root):
    (root / "caf\u00e9" / "copy.off").write_bytes((root / "box" / "b.off").read_bytes())
    assert object_split("b") == object_split("copy")
    assert run("check-objects", root).exit_code == 0
    (root / "caf\u00e9" / "d.off").write_bytes((root / "box" / "b.off").read_bytes())
    assert object_split("d") == "test"
    assert run("check-objects", root).exit_code == 1
    for split in ("train", "test"):
        command = ("render", "--n", "1", "--objects-root", root, "--out", "r.h5")
        refuses(*command, "--object-split", split, words=("d.off", "two splits"))


def deadly(up, cache_dir, file):
    if file.name == "box/1":
        os._exit(1)
    return ModelCheck(file.name, True, "", 1)


def test_a_model_that_crashes_its_process_is_refused_alone(tmp_path, monkeypatch):
    (tmp_path / "models" / "box").mkdir(parents=True)
    for i in range(2):
        (tmp_path / "models" / "box" / f"{i}.off").write_text(BOX.export(file_type="off"))
    monkeypatch.setattr(check, "_check_in_worker", deadly)
    found = check_models(open_objects(tmp_path / "models"), None, 2)
    assert [(r.name, r.ok) for r in found] == [(f"box/{i}", i != 1) for i in range(2)]
    assert ["exit code 1" in r.reason for r in found] == [not r.ok for r in found]
