"""Which heavy modules a start-up leaves out."""

import json
import subprocess
import sys

import pytest

HEAVY = (
    "mitsuba", "drjit", "numpy", "h5py", "trimesh", "scipy", "PIL", "OpenEXR", "tqdm", "torch",
    "safetensors", "tensorboard", "pyarrow", "inspect_ai", "rerun",
)  # fmt: skip
LIGHT = (
    "scenegen --help", "scenegen --version", "scenegen render --help", "scenegen verify --help",
    "scenegen export --help", "scenegen card --help", "scenegen view --help",
    "scenegen render --n x", "iqtt --help", "iqtt quiz --help", "bench --help",
    "bench baseline --help", "bench train --help", "bench view --help", "pix2shape --help",
    "pix2shape --version", "pix2shape train --help", "pix2shape predict --help",
    "pix2shape sample --help", "pix2shape train --data x --out x --set batch",
)  # fmt: skip
# Runs command lines one after the other; prints the heavy modules of which each is the first user.
COMMANDS = f"""
import contextlib, io, json, sys
import cli
def heavy():
    return set({HEAVY!r}) & set(sys.modules)
loaded = {{"import": sorted(heavy())}}
for line in sys.argv[1:]:
    before = heavy()
    program, *words = line.split()
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        with contextlib.suppress(SystemExit):
            getattr(cli, program)(words)
    loaded[line] = sorted(heavy() - before)
print(json.dumps(loaded))
"""


def python(code, *arguments, cwd):
    command = [sys.executable, "-c", code, *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=True, cwd=cwd).stdout


def first_users(*lines, cwd):
    """Return the heavy modules that importing `cli` and each of these command lines load."""
    return json.loads(python(COMMANDS, *lines, cwd=cwd))


def test_importing_the_packages_loads_nothing_heavy(tmp_path):
    packages = "scenegen, iqtt, metrics, baselines.pix2shape, baselines.resnets, cli"
    code = f"import sys, {packages}; print(*set({HEAVY!r}) & set(sys.modules))"
    assert python(code, cwd=tmp_path) == "\n"


def test_help_loads_nothing_heavy(tmp_path):
    render = "scenegen render --n 1 --size 32 --out nowhere/x.h5"
    loaded = first_users(*LIGHT, render, cwd=tmp_path)
    assert loaded.pop(render), "this check can fail"
    assert {line: names for line, names in loaded.items() if names} == {}


def test_reading_a_file_loads_no_renderer(rooms_path, tmp_path):
    path = str(rooms_path)
    read = f"scenegen.open_rooms({path!r})[0].points_world; scenegen.RoomsDataset({path!r})[0]"
    code = f"import sys, scenegen; {read}; print(*sorted(set({HEAVY!r}) & set(sys.modules)))"
    assert python(code, cwd=tmp_path) == "h5py numpy\n"


def test_scoring_and_auditing_load_no_renderer_and_no_torch(rooms_path, released, tmp_path):
    baseline = f"bench baseline empty-room --data {rooms_path}"
    score = "bench score predictions.h5 --json s.json --html s.html --processes 1"
    audit = f"iqtt audit {released()}"
    loaded = first_users(baseline, score, audit, cwd=tmp_path)
    assert set(loaded[baseline]) <= {"h5py", "numpy", "scipy", "tqdm"}
    assert not {"mitsuba", "drjit", "torch"} & {*loaded[score], *loaded[audit]}
    assert (tmp_path / "s.html").exists()


def test_names_of_the_package():
    import scenegen

    for name in " ".join(scenegen.HOMES.values()).split():
        assert getattr(scenegen, name) is not None
    with pytest.raises(AttributeError, match="has no attribute 'nothing'"):
        _ = scenegen.nothing
