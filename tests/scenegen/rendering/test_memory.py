"""Kernels read whole SIMD packets, so arrays need memory of their own behind the last element."""

import ast
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from PIL import Image

import scenegen
from scenegen.description.presets import PRESETS

GUARDED = Path(__file__).parents[2] / "support" / "guarded_memory.py"
RENDERING = Path(scenegen.__file__).parent / "rendering"
TRUTH = ("--with", "amodal,coordinates,flow,albedo", "--views", "0,20")
QUESTIONS = ("--train", "4", "--labeled", "2", "--val", "2", "--test", "2")


def rooms(*options: str) -> list[str]:
    size = ("--n", "3", "--size", "37x35", "--spp", "3", "--min-visible-pixels", "2")
    return ["scenegen", "render", *size, *options, "--workers", "0", "--overwrite"]


def survives(commands: list[list[str]], folder: Path) -> None:
    """Check that commands run with arrays that end before pages which may not be read."""
    (folder / "commands.json").write_text(json.dumps(commands))
    arguments = [sys.executable, "-X", "faulthandler", str(GUARDED), "commands.json"]
    ended = subprocess.run(arguments, cwd=folder, capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stdout + ended.stderr


def test_no_kernel_reads_beyond_an_array(tmp_path):
    """Unit scenes with trees, triangles that are rasterised, large ones, shadows, cubes."""
    questions = ["iqtt", "make-split", *QUESTIONS, "--size", "48", "--workers", "0"]
    survives([rooms("--shadows"), rooms("--preset", "shapenet", "--shadows"), questions], tmp_path)


@pytest.mark.slow
def test_nothing_that_is_rendered_reads_beyond_an_array(tmp_path, meshes):
    paint = np.random.default_rng(0).integers(0, 256, (64, 64, 3), np.uint8)
    (tmp_path / "maps" / "Wood051").mkdir(parents=True)
    Image.fromarray(paint).save(tmp_path / "maps" / "Wood051" / "Wood051_1K-JPG_Color.png")
    sky = {"RGB": np.ones((16, 32, 3), np.float32)}
    OpenEXR.File({"type": OpenEXR.scanlineimage}, sky).write(str(tmp_path / "sky.exr"))
    own = ("--objects-root", str(meshes), "--cache-dir", "cache", "--reflectance", "own")
    interior = ("--preset", "interiors", "--no-denoise")
    streams = "import scenegen\nfor on_device in (False, True):\n" + "".join(
        f"    list(scenegen.RoomStream({name!r}, batch=3, stop=6, on_device=on_device))\n"
        for name in ("shapes", "shapenet")
    )
    questions = ["iqtt", "make-split", "--preset", "suite", *QUESTIONS, "--workers", "0"]
    commands = [
        *(rooms("--preset", name) for name in PRESETS if name != "interiors"),
        rooms("--shadows", *TRUTH),
        rooms("--preset", "shapenet", "--shadows", *TRUTH),
        rooms("--shading", "path", "--specular", "0.5"),
        rooms("--preset", "shapenet", "--shading", "path"),
        rooms(*own, *TRUTH),
        rooms(*interior, "--hours", "20", *TRUTH),
        rooms(*interior, "--materials", "maps", "--environment", "sky.exr"),
        rooms(*interior, *own[:4]),
        questions,
        ["python", streams],
    ]
    survives(commands, tmp_path)


def test_only_tables_hands_arrays_of_numpy_to_dr_jit():
    """No call `mi.Type(...)` elsewhere has an argument that names numpy or slices an array."""
    calls = 0
    for path in sorted(RENDERING.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            if not isinstance(node, ast.Call) or path.name == "tables.py":
                continue
            name = ast.unparse(node.func)
            if name.startswith("mi.") and name[3:4].isupper():
                calls += 1
                words = "".join(ast.unparse(argument) for argument in node.args)
                marks = ("np.", ".astype(", ".ravel(", ".numpy(", "batch.", ":, ", ", :")
                plain = ".tolist()" in words or "float(" in words
                assert plain or not any(mark in words for mark in marks), f"{path}: {words}"
    assert calls > 100
