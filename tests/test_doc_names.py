"""Pages name modules, folders, commands and options that there are."""

import ast
import re
import shlex
from functools import cache
from pathlib import Path

import click
import pytest

import cli

ROOT = Path(__file__).parents[1]
PAGES = [
    *(ROOT / "docs").rglob("*.md"), ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "Makefile"
]  # fmt: skip
PROGRAMS = {name: getattr(cli, name) for name in ("scenegen", "iqtt", "bench", "pix2shape")}
PACKAGES = "scenegen|iqtt|metrics|baselines|benchmarks|examples|tests"
MODULE = re.compile(rf"\bpython3? -m ((?:{PACKAGES})[\w.]*)")
DOTTED = re.compile(rf"`((?:{PACKAGES})(?:\.\w+)+)")
FILE = re.compile(rf"`((?:{PACKAGES})/[\w/]+(?:\.py|/))`")
SPAN = re.compile(r"`([^`\n]+(?:\n[^`\n]+)?)`")
LINE = re.compile(
    r"^(?:    |\t)?[@$ ]*(?:\$\(BIN\)/)?((?:scenegen|iqtt|bench|pix2shape) .*)$", re.M
)
FILES = ("h5", "html", "json", "md", "png", "py", "safetensors", "yaml")  # endings of file names
OTHERS = {"--depth-unit-scale-factor", "--folder", "--nthreads"}  # of other programs


def page_id(path):
    return str(path.relative_to(ROOT))


def is_there(name):
    """Whether a dotted name is a module, or is defined in one."""
    parts = name.split(".")
    for count in range(len(parts), 0, -1):
        path = ROOT.joinpath(*parts[:count])
        file = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
        if path.is_dir() or file.is_file():
            text = file.read_text() if file.is_file() else ""
            rest = parts[count : count + 1]
            return all(
                re.search(rf"(?:def|class) {n}\b|\b{n}\b *[:=\"]|\b{n} ", text) for n in rest
            )
    return False


@cache
def options_of(command):
    names = {name for p in command.params for name in (*p.opts, *p.secondary_opts)}
    return names | {"--help", "--version"}


def command_of(words):
    """Return the command that words begin with, and how many of them name it."""
    command, count = PROGRAMS[words[0]], 1
    while isinstance(command, click.Group) and words[count : count + 1]:
        following = command.get_command(click.Context(command), words[count])
        if following is None:
            return None, count
        command, count = following, count + 1
    return command, count


def wrong_in(line):
    """Return what is not there of the command that a line calls, or None."""
    try:
        words = shlex.split(line.replace("\\\n", " "), comments=True)
    except ValueError:
        words = line.split()
    ends = [
        i for i, word in enumerate(words) if word in ("|", "&&", "||", ";", ">", "<", "&", "--")
    ]
    words = words[: min(ends, default=len(words))]
    if len(words) < 2 or not re.fullmatch(r"[a-z0-9-]+", words[1]):
        return None
    command, count = command_of(words)
    if command is None:
        return words[count]
    used = {word.partition("=")[0] for word in words[count:] if word.startswith("--")}
    return next(iter(sorted(used - options_of(command))), None)


@cache
def every_option():
    names, waiting = set(), list(PROGRAMS.values())
    while waiting:
        command = waiting.pop()
        names |= options_of(command)
        if isinstance(command, click.Group):
            context = click.Context(command)
            waiting += [command.get_command(context, n) for n in command.list_commands(context)]
    return names


@pytest.mark.parametrize("page", PAGES, ids=page_id)
def test_modules_and_files_are_there(page):
    text = page.read_text()
    names = {name.rstrip(".") for name in MODULE.findall(text) + DOTTED.findall(text)}
    names = {name for name in names if not name.endswith(FILES)}
    assert sorted(name for name in names if not is_there(name)) == []
    assert [path for path in FILE.findall(text) if not (ROOT / path).exists()] == []


@pytest.mark.parametrize("page", PAGES, ids=page_id)
def test_commands_and_options_are_there(page):
    text = page.read_text().replace("\\\n", " ")
    lines = LINE.findall(text)
    lines += [s.replace("\n", " ") for s in SPAN.findall(text) if s.split(" ")[0] in PROGRAMS]
    assert [(line, wrong) for line in lines if (wrong := wrong_in(line))] == []
    spans = " ".join(s for s in SPAN.findall(text) if s.startswith("--"))
    options = set(re.findall(r"(?<![\w-])--[a-z][a-z-]+", spans))
    assert sorted(options - every_option() - OTHERS) == []


def test_what_benchmarks_and_examples_import_is_there():
    """No other check reads them."""
    for path in [*(ROOT / "benchmarks").rglob("*.py"), *(ROOT / "examples").rglob("*.py")]:
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ImportFrom) and re.match(PACKAGES, node.module or ""):
                names = [f"{node.module}.{alias.name}" for alias in node.names]
                assert [name for name in names if not is_there(name)] == [], path
