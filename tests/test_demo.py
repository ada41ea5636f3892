"""The table at the end of `make demo` names what its commands write, and how much of it."""

import os
import re
import shutil
import subprocess
from itertools import pairwise
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
ENVIRONMENT = {name: value for name, value in os.environ.items() if not name.startswith("MAKE")}


def made(*arguments):
    if shutil.which("make") is None:
        pytest.skip("no make")
    command = ["make", "--no-print-directory", *arguments]
    return subprocess.run(
        command, cwd=ROOT, env=ENVIRONMENT, capture_output=True, text=True, check=True
    ).stdout


@pytest.fixture(scope="module")
def table():
    """Return name, items and words of each line."""
    lines = re.findall(r"^  (\S.*?)  +(\S.*?)  +(.*)$", made("-s", "demo-summary"), re.MULTILINE)
    assert lines[0] == ("file", "items", "what it is")
    return lines[1:]


@pytest.fixture(scope="module")
def commands():
    return [line.split("/bin/")[-1].split() for line in made("-n", "demo").splitlines()]


def test_the_table_names_files_that_the_demo_writes(table, commands):
    written = {word.removeprefix("demo/") for words in commands for word in words}
    assert [name for name, *_ in table if "*" not in name and name not in written] == []
    assert len(table) > 8


def test_the_table_counts_scenes_as_they_are_asked_for(table, commands):
    items = {name: int(count.split()[0].replace(",", "")) for name, count, _ in table}
    for words in commands:
        if words[:2] == ["scenegen", "render"]:
            asked = dict(pairwise(words))
            views = len(asked.get("--views", "0").split(","))
            assert items[asked["--out"].removeprefix("demo/")] == int(asked["--n"]) * views


def test_the_page_to_open_has_its_whole_path():
    (page,) = re.findall("Open first: +(.*)", made("-s", "demo-summary"))
    assert page == f"{ROOT}/demo/report.html"
