"""The tree in docs/architecture.md is that of the code, file by file, in the code's own words."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs" / "architecture.md").read_text()
MODULES = sorted(
    path
    for package in ("scenegen", "iqtt", "metrics", "baselines")
    for path in (ROOT / package).rglob("*.py")
)


def first_sentence(path):
    return (
        (ast.get_docstring(ast.parse(path.read_text())) or "").split("\n\n")[0].replace("\n", " ")
    )


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(ROOT)))
def test_the_page_says_what_each_file_is(path):
    name = f"{path.parent.relative_to(ROOT)}/" if path.name == "__init__.py" else path.name
    assert f"`{name}` {first_sentence(path)}\n" in PAGE


def test_the_page_names_no_file_that_is_gone():
    listed = PAGE.split("## The tree")[1].count("- `")
    assert listed == len(MODULES)
