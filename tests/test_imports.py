"""Who may import whom, and which heavy modules a start-up leaves out."""

import ast
import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
HEAVY = (
    "mitsuba", "drjit", "numpy", "h5py", "trimesh", "scipy", "PIL", "OpenEXR", "tqdm", "torch",
    "lightning_fabric", "safetensors", "tensorboard", "pyarrow", "inspect_ai", "rerun",
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
    assert "numpy" in loaded.pop(render), "this check can fail"
    assert {line: names for line, names in loaded.items() if names} == {}


def test_the_tab_key_opens_no_file_and_loads_nothing_heavy(rooms_path, tmp_path):
    words = f"scenegen preview {rooms_path} --se"
    code = f"""
import os, sys
os.environ.update(COMP_WORDS={words!r}, COMP_CWORD="3", _SCENEGEN_COMPLETE="bash_complete")
import cli
try:
    cli.scenegen(prog_name="scenegen")
finally:
    print(*set({HEAVY!r}) & set(sys.modules))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.stdout == "plain,--seed\n\n", done.stderr


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


def broken_contracts(cwd):
    code = "from importlinter.cli import lint_imports_command; lint_imports_command()"
    command = [sys.executable, "-c", code, "--no-cache"]
    done = subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False)
    assert re.search(r"Contracts: \d+ kept, \d+ broken", done.stdout), done.stdout + done.stderr
    return re.findall("^(.*) BROKEN", done.stdout, re.MULTILINE)


def test_contracts_between_packages():
    assert broken_contracts(ROOT) == []


def imports_of(path, modules):
    """Return which of these modules a file imports, at its top or inside its functions."""
    found, types = set(), set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            types |= set(ast.walk(node))
        elif isinstance(node, ast.ImportFrom) and node not in types:
            names = {f"{node.module}.{name.name}" for name in node.names}
            found |= (names & modules.keys()) or ({node.module} & modules.keys())
    return found


def circles(root):
    """Return the modules of the packages that import themselves by way of others."""
    modules = {
        ".".join(path.relative_to(root).with_suffix("").parts).removesuffix(".__init__"): path
        for package in ("scenegen", "iqtt", "metrics", "baselines")
        for path in (root / package).rglob("*.py")
    }
    direct = {name: imports_of(path, modules) for name, path in modules.items()}
    reached = {name: set(others) for name, others in direct.items()}
    for middle in modules:
        for name in modules:
            if middle in reached[name]:
                reached[name] |= reached[middle]
    return {name for name in modules if name in reached[name]}


def test_no_module_imports_itself_by_way_of_others(tmp_path):
    assert circles(ROOT) == set()
    (tmp_path / "iqtt").mkdir()
    (tmp_path / "iqtt/a.py").write_text("from iqtt import b\n")
    (tmp_path / "iqtt/b.py").write_text("def f():\n    from iqtt.a import c\n")
    assert circles(tmp_path) == {"iqtt.a", "iqtt.b"}


def test_contracts_can_break(tmp_path):
    """In a copy where a low module imports a high one, and camera Mitsuba and torch."""
    for name in ("scenegen", "iqtt", "metrics", "baselines"):
        shutil.copytree(ROOT / name, tmp_path / name, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("cli.py", "pyproject.toml"):
        shutil.copy(ROOT / name, tmp_path)
    with (tmp_path / "scenegen" / "camera.py").open("a") as file:
        file.write("\nimport mitsuba, torch\nfrom scenegen.rooms import make\n")
    assert broken_contracts(tmp_path) == [
        "Folders of scenegen",
        "Only rendering imports Mitsuba and Dr.Jit",
        "Only the baselines import torch",
    ]
