"""The check of a whole folder: its table, its JSON, and that no model stops it."""

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import trimesh
from click.testing import CliRunner, Result

from scenegen.commands.meshes import COMMANDS
from scenegen.common.command_line import PackageCommands
from scenegen.objects.meshes import check
from scenegen.objects.meshes.check import ModelCheck, check_models
from scenegen.objects.meshes.folders import open_models, open_objects

BOX = trimesh.creation.box()
PR_CAPBSET_DROP, CAP_DAC_OVERRIDE, CAP_DAC_READ_SEARCH = 24, 1, 2


class Alone(PackageCommands):
    """The command group with nothing but the command under test."""

    def _loaded(self) -> list[Any]:
        return list(COMMANDS)


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Result]:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "xdg"))

    def call(*arguments: object) -> Result:
        words = ["check-objects", *map(str, arguments)]
        result = CliRunner().invoke(Alone(packages=()), words)
        if result.exception is not None and not isinstance(result.exception, SystemExit):
            raise AssertionError(f"a traceback: {result.exception!r}") from result.exception
        return result

    return call


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """Two classes: four good boxes, one with a double face, one empty file, one with no faces."""
    root = tmp_path / "models"
    for name in ("box/a", "box/b", "box/c", "caf\u00e9/d"):
        path = root / f"{name}.off"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(BOX.export(file_type="off"))
    double = trimesh.Trimesh(BOX.vertices, [*BOX.faces, BOX.faces[0]], process=False)
    (root / "box" / "double.off").write_text(double.export(file_type="off"))
    (root / "box" / "empty.obj").touch()
    (root / "caf\u00e9" / "points.obj").write_text("v 0 0 0\n")
    return root


def test_table_and_json(run: Callable[..., Result], root: Path, tmp_path: Path) -> None:
    result = run(root, "--json", "out.json")
    assert result.exit_code == 0, result.output
    rows = [line.split() for line in result.stdout.splitlines()]
    assert rows[:4] == [
        ["class", "models", "ok", "mended", "refused", "faces"],
        ["box", "5", "4", "1", "1", "48"],
        ["caf\u00e9", "2", "1", "0", "1", "12"],
        ["total", "7", "5", "1", "2", "60"],
    ]
    assert result.stdout.splitlines()[4:] == [
        "refused  box/empty: the file is empty",
        "refused  caf\u00e9/points: has 1 vertices but no faces",
    ]
    told = json.loads((tmp_path / "out.json").read_text(encoding="utf-8"))
    assert (told["kind"], told["up"]) == ("folder", "y")
    assert told["digest"] == open_objects(root).digest()
    by_name = {model["name"]: model for model in told["models"]}
    assert list(by_name) == [f"box/{i}" for i in ("a", "b", "c", "double", "empty")] + [
        "caf\u00e9/d", "caf\u00e9/points",
    ]  # fmt: skip
    assert by_name["box/double"]["mended"]["double_faces"] == 1
    assert by_name["box/empty"] | {"seconds": 0} == {
        "name": "box/empty", "ok": False, "reason": "the file is empty", "faces": 0, "mended": {},
        "seconds": 0,
    }  # fmt: skip
    assert len(list((tmp_path / "xdg/pix2shape-bench/meshes").iterdir())) == 3, "equal files: one"


def test_options(run: Callable[..., Result], root: Path, tmp_path: Path) -> None:
    result = run(root, "--classes", "caf\u00e9", "--cache-dir", "here", "--up", "z", "--jobs", 2)
    assert result.exit_code == 0, result.output
    assert "box" not in result.stdout
    assert len(list((tmp_path / "here").iterdir())) == 2
    assert not (tmp_path / "xdg").exists()
    (tmp_path / "there.json").touch()
    assert "exists already" in run(root, "--json", "there.json").stderr
    assert run(root, "--json", "there.json", "--overwrite").exit_code == 0
    assert (tmp_path / "there.json").stat().st_size


def test_exit_codes(run: Callable[..., Result], root: Path, tmp_path: Path) -> None:
    """1 where no model can be used, 2 where the request makes no sense."""
    (root / "bad").mkdir()
    (root / "bad" / "x.stl").write_text("solid")
    result = run(root, "--classes", "bad")
    assert result.exit_code == 1
    assert "refused  bad/x: is no STL file" in result.stdout
    for arguments, words in (
        (("nothing",), "nothing: no such folder"),
        ((root, "--classes", "mug"), "found no class mug; there are bad, box, caf\u00e9"),
        ((root, "--json", "no/where.json"), "the folder does not exist"),
    ):
        result = run(*arguments)
        assert (result.exit_code, result.stdout) == (2, "")
        assert result.stderr.startswith("Error: ")
        assert words in result.stderr


@pytest.mark.parametrize("inside", ["model.obj", "models/model_normalized.obj"])
def test_shapenet_is_recognised(run: Callable[..., Result], tmp_path: Path, inside: str) -> None:
    """A model whose file is missing is refused, the others are not."""
    for model_id in ("1a", "2b"):
        path = tmp_path / "net" / "03797390" / model_id / inside
        path.parent.mkdir(parents=True)
        path.write_text(BOX.export(file_type="obj"))
    (tmp_path / "net" / "03797390" / "3c").mkdir()
    result = run("net")
    assert result.exit_code == 0
    assert result.stdout.splitlines()[1].split() == ["mug", "3", "2", "0", "1", "24"]
    assert "refused  mug/3c: the file does not exist" in result.stdout


def test_jobs_give_what_one_gives(root: Path, tmp_path: Path) -> None:
    folder, ticks = open_objects(root), []
    alone = check_models(folder, None, 1, ticks.append)
    together = check_models(folder, tmp_path / "cache", 3, ticks.append)
    assert ticks == [1] * 14
    assert [r.__dict__ | {"seconds": 0} for r in alone] == [
        r.__dict__ | {"seconds": 0} for r in together
    ]
    assert [r.name for r in alone] == [f.name for c in folder.classes for f in folder.models[c]]
    assert all(r.ok == (not r.reason) for r in alone)
    assert [r.was_mended for r in alone] == [r.name == "box/double" for r in alone]


DEADLY = """
import os, sys
from scenegen.objects.meshes import cache
from scenegen.objects.meshes import check
from scenegen.objects.meshes.folders import open_objects
if __name__ == "__main__":
    for record in check.check_models(open_objects(sys.argv[1]), None, 2, None):
        print(record.name, record.ok, record.reason)
else:  # in the processes that do the work
    parse = cache.parse_mesh
    def deadly(data, suffix):
        if b"deadly" in data:
            os._exit(1)
        return parse(data, suffix)
    cache.parse_mesh = deadly
"""


def test_a_model_that_takes_its_process_down_is_refused_alone(tmp_path: Path) -> None:
    for i in range(12):
        path = tmp_path / "models" / "box" / f"{i:02d}.off"
        path.parent.mkdir(parents=True, exist_ok=True)
        text = BOX.export(file_type="off")
        path.write_text(text + "# deadly\n" if i in (3, 4) else text)
    (tmp_path / "deadly.py").write_text(DEADLY)
    command = [sys.executable, tmp_path / "deadly.py", tmp_path / "models"]
    environment = os.environ | {"PYTHONPATH": str(Path(check.__file__).parents[2])}
    done = subprocess.run(
        command, capture_output=True, text=True, check=False, timeout=120, env=environment
    )
    lines = done.stdout.splitlines()
    assert len(lines) == 12, done.stderr
    for i, line in enumerate(lines):
        assert line.startswith(f"box/{i:02d} {i not in (3, 4)} "), line
        assert ("ended the process" in line) == (i in (3, 4))


def test_a_script_that_cannot_be_imported_is_told_so(root: Path) -> None:
    """Each process imports the caller's script, and so would start the check anew."""
    code = f"""
from scenegen.objects.meshes import check
from scenegen.objects.meshes import folders
check.check_models(folders.open_objects({str(root)!r}), None, 2)
"""
    script = root.parent / "script.py"
    script.write_text(code)
    environment = os.environ | {"PYTHONPATH": str(Path(check.__file__).parents[2])}
    done = subprocess.run(
        [sys.executable, script], capture_output=True, text=True, check=False, env=environment
    )
    assert done.returncode == 1
    assert done.stderr.rstrip().splitlines()[-1].endswith("or with jobs=1")


@pytest.mark.skipif(sys.platform != "linux", reason="uses Linux system calls")
@pytest.mark.parametrize("jobs", ["1", "2"])
def test_unreadable_files_are_refused_and_unwritable_caches_are_told_of(
    root: Path, jobs: str
) -> None:
    """Root gives up its rights over files, so that this tests something for root too."""
    (root / "box" / "a.off").chmod(0)
    cache = root.parent / "locked"
    cache.mkdir(mode=0o555)
    code = f"""
import ctypes, os, sys
for right in ({CAP_DAC_OVERRIDE}, {CAP_DAC_READ_SEARCH}):
    ctypes.CDLL(None).prctl({PR_CAPBSET_DROP}, right, 0, 0, 0)
os.execv(sys.executable, [sys.executable, "-c", sys.argv[1], *sys.argv[2:]])
"""
    inner = (
        "import click, sys; from scenegen.common.command_line import PackageCommands;"
        "from scenegen.commands.meshes import COMMANDS;"
        "PackageCommands._loaded = lambda self: list(COMMANDS);"
        "PackageCommands(packages=())(sys.argv[1:])"
    )
    options = ["check-objects", str(root), "--cache-dir", str(cache), "--jobs", jobs]
    done = subprocess.run(
        [sys.executable, "-c", code, inner, *options],
        capture_output=True,
        text=True,
        check=False,
        cwd=Path(check.__file__).parents[2],
    )
    assert done.returncode == 0, done.stderr
    assert "refused  box/a: cannot be read: Permission denied" in done.stdout
    assert done.stderr.count("cleaned models cannot be kept there") == 1
    assert done.stderr.startswith(f"note: {cache}")
    assert done.stderr.count("\n") == 1


def test_the_check_says_no_more_than_it_knows() -> None:
    assert not ModelCheck(
        "a/b", True, "", 1, {"merged_vertices": 9, "unused_vertices": 9}
    ).was_mended
    assert ModelCheck("a/b", True, "", 1, {"degenerate_faces": 1}).was_mended


def test_a_recognised_folder_needs_no_long_look(tmp_path: Path) -> None:
    for i in range(300):
        (tmp_path / "models" / "00000001" / f"{i}").mkdir(parents=True)
    (tmp_path / "models" / "00000002" / "x").mkdir(parents=True)
    (tmp_path / "models" / "00000002" / "x" / "model.obj").touch()
    started = time.process_time()
    assert open_models(tmp_path / "models").kind == "shapenet-v1"
    assert time.process_time() - started < 2
