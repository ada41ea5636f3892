"""Who may import whom, and what a start-up must not load."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
HEAVY = (
    "mitsuba", "drjit", "numpy", "h5py", "trimesh", "scipy", "PIL", "OpenEXR", "tqdm", "torch",
    "lightning_fabric", "safetensors", "tensorboard", "pyarrow", "starlette", "uvicorn", "viser",
)  # fmt: skip
PIX2SHAPE = ("train", "predict", "sample", "interpolate", "rotate")
CHECK = f"""
import sys
{{code}}
print(*sorted(set({HEAVY!r}) & set(sys.modules)))
"""
QUIETLY = """
import contextlib, io
import cli
with contextlib.redirect_stdout(io.StringIO()), contextlib.suppress(SystemExit):
    cli.{group}({arguments!r})
"""


def heavy_after(code, cwd):
    """Return which heavy modules a fresh Python has loaded after running code."""
    done = subprocess.run(
        [sys.executable, "-c", CHECK.format(code=code)],
        capture_output=True,
        text=True,
        check=True,
        cwd=cwd,
    )
    return done.stdout.split()


@pytest.mark.parametrize(
    "package", ["scenegen", "iqtt", "metrics", "baselines.pix2shape", "baselines.cnn", "cli"]
)
def test_importing_a_package_loads_nothing_heavy(package, tmp_path):
    assert heavy_after(f"import {package}", tmp_path) == []


@pytest.mark.parametrize(
    ("group", "arguments"),
    [
        ("scenegen", ["--help"]),
        ("scenegen", ["--version"]),
        ("scenegen", ["render", "--help"]),
        ("scenegen", ["verify", "--help"]),
        ("scenegen", ["export", "--help"]),
        ("scenegen", ["card", "--help"]),
        ("scenegen", ["view", "--help"]),
        ("scenegen", ["render", "--n", "x"]),
        ("iqtt", ["--help"]),
        ("iqtt", ["quiz", "--help"]),
        ("bench", ["--help"]),
        ("bench", ["baseline", "--help"]),
        ("bench", ["train", "--help"]),
        ("bench", ["view", "--help"]),
        ("pix2shape", ["--help"]),
        ("pix2shape", ["--version"]),
        *(("pix2shape", [name, "--help"]) for name in PIX2SHAPE),
        ("pix2shape", ["train", "--data", "x", "--out", "x", "--set", "batch"]),
    ],
)
def test_help_loads_nothing_heavy(group, arguments, tmp_path):
    assert heavy_after(QUIETLY.format(group=group, arguments=arguments), tmp_path) == []


def test_reading_a_file_loads_no_renderer(rooms_path, tmp_path):
    code = f"import scenegen; scenegen.open_rooms({str(rooms_path)!r})[0].points_world"
    assert heavy_after(code, tmp_path) == ["h5py", "numpy"]
    code = f"import scenegen; scenegen.RoomsDataset({str(rooms_path)!r})[0]"
    assert heavy_after(code, tmp_path) == ["h5py", "numpy"]


def test_trivial_baselines_load_no_torch(rooms_path, tmp_path):
    baseline = ["baseline", "empty-room", "--data", str(rooms_path)]
    loaded = heavy_after(QUIETLY.format(group="bench", arguments=baseline), tmp_path)
    assert (tmp_path / "predictions.h5").exists()
    assert set(loaded) <= {"h5py", "numpy", "scipy", "tqdm"}


def test_scoring_loads_no_renderer_and_no_torch(rooms_path, tmp_path):
    baseline = ["baseline", "empty-room", "--data", str(rooms_path)]
    heavy_after(QUIETLY.format(group="bench", arguments=baseline), tmp_path)
    score = ["score", "predictions.h5", "--json", "s.json", "--html", "s.html", "--processes", "1"]
    loaded = heavy_after(QUIETLY.format(group="bench", arguments=score), tmp_path)
    assert (tmp_path / "s.html").exists()
    assert not {"mitsuba", "drjit", "torch"} & set(loaded)
    # The check can fail: the same command with the renderer loaded first.
    code = "import mitsuba\n" + QUIETLY.format(group="bench", arguments=["--help"])
    assert "mitsuba" in heavy_after(code, tmp_path)


def test_this_check_can_fail(tmp_path):
    assert heavy_after("import scenegen; scenegen.make_dataset", tmp_path) != []
    render = ["render", "--n", "1", "--size", "32", "--out", "nowhere/x.h5"]
    assert "numpy" in heavy_after(QUIETLY.format(group="scenegen", arguments=render), tmp_path)


def test_names_of_the_package():
    import scenegen

    for name in " ".join(scenegen.HOMES.values()).split():
        assert getattr(scenegen, name) is not None
    with pytest.raises(AttributeError, match="has no attribute 'nothing'"):
        _ = scenegen.nothing


def lint(cwd):
    code = "from importlinter.cli import lint_imports_command; lint_imports_command()"
    command = [sys.executable, "-c", code, "--no-cache"]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False)


def test_contracts_between_packages():
    pytest.importorskip("importlinter")
    done = lint(ROOT)
    assert done.returncode == 0, done.stdout + done.stderr
    assert " 0 broken" in done.stdout


def test_contracts_can_break(tmp_path):
    """In a copy where a low module imports a high one, and camera mitsuba and torch."""
    pytest.importorskip("importlinter")
    for name in ("scenegen", "iqtt", "metrics", "baselines"):
        shutil.copytree(ROOT / name, tmp_path / name, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("cli.py", "pyproject.toml"):
        (tmp_path / name).write_text((ROOT / name).read_text())
    with (tmp_path / "scenegen" / "camera.py").open("a") as file:
        file.write("\nimport mitsuba, torch\nfrom scenegen.rooms import make\n")
    with (tmp_path / "metrics" / "report" / "charts.py").open("a") as file:
        file.write("\nfrom metrics.report import page\n")
    done = lint(tmp_path)
    assert done.returncode == 1
    broken = (
        "Folders of scenegen",
        "Files of metrics.report",
        "Only rendering knows mitsuba",
        "torch stays in the",
    )
    for title in broken:
        assert re.search(rf"^{title}.* BROKEN$", done.stdout, re.MULTILINE), title
    assert "scenegen.camera -> mitsuba" in done.stdout
    assert "Nothing imports the command line KEPT" in done.stdout
