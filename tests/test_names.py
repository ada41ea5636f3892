"""Docstrings of packages and docs/architecture.md name modules and folders that there are."""

import ast
import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("scenegen", "iqtt", "metrics", "baselines")
PROGRAMS = ("scenegen", "iqtt", "bench", "pix2shape")
LIBRARIES = ("datasets",)
FOLDERS = [init.parent for package in PACKAGES for init in (ROOT / package).rglob("__init__.py")]


def is_there(path):
    return path.is_dir() or path.with_suffix(".py").is_file()


def defined(folder):
    """Return the functions of the modules of a folder, their parameters, and its `HOMES`."""
    names = set()
    for path in folder.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.FunctionDef):
                names |= {node.name, *(a.arg for a in (*node.args.args, *node.args.kwonlyargs))}
    return names


def resolves(name, folder):
    """Whether a name is a module beside or above, an attribute of one, or told by the folder."""
    if name in (*PROGRAMS, *LIBRARIES):
        return True
    path = Path(name.rstrip("/").removesuffix(".py").replace(".", "/"))
    inside = folder.relative_to(ROOT).parents
    homes = [folder, *(ROOT / parent for parent in inside)]
    places = [home / place for home in homes for place in (path, path.parent) if place.parts]
    return any(map(is_there, places)) or name in defined(folder)


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda f: str(f.relative_to(ROOT)))
def test_docstrings_of_packages(folder):
    text = ast.get_docstring(ast.parse((folder / "__init__.py").read_text())) or ""
    calls = re.findall(r"\w+", " ".join(re.findall(r"`(\w+\([^`]*\))`", text)))
    names = set(re.findall(r"`([a-z_]+(?:[./][a-z_]+)*/?)`", text)) - set(calls)
    assert [name for name in names if not resolves(name, folder)] == []


def test_a_name_that_is_gone_is_found():
    assert resolves("pool", ROOT / "scenegen/files")
    assert resolves("scenegen.rendering", ROOT / "iqtt/files")
    assert not resolves("leaderboard", ROOT / "metrics")
    assert not resolves("shards", ROOT / "scenegen/files")


def test_the_page_of_the_architecture():
    """Folders and files that it names are there, and its tables have every folder of a package."""
    text = (ROOT / "docs/architecture.md").read_text()
    listed, package = {}, ""
    for line in text.splitlines():
        names = re.findall(r"`([\w/]+(?:/|\.py))`", line)
        if line.startswith("| `") and line.endswith("| |"):
            package = names.pop().rstrip("/")
        homes = [ROOT / package] if line.startswith("|") else [ROOT, *map(ROOT.joinpath, PACKAGES)]
        for name in names:
            assert any((home / name).exists() for home in homes), name
        if line.startswith("|"):
            cell = re.findall(r"`([\w/.]+)`", line.split("|")[1])
            listed.setdefault(package, set()).update(name.rstrip("/") for name in cell)
    for package in PACKAGES:
        there = {init.parent.name for init in (ROOT / package).glob("*/__init__.py")}
        assert there <= listed[package]


def test_all_packages_are_typed():
    """With a file py.typed, which the wheel has too (PEP 561)."""
    data = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]
    for package in PACKAGES:
        assert (ROOT / package / "py.typed").is_file()
        assert "py.typed" in data["package-data"][package]
