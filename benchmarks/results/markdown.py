"""Tables in Markdown, and their places in docs/results.md, between two comments each."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from scenegen.files.new_file import write_text

NOTHING = "–"


def table(head: Sequence[str], rows: Sequence[Sequence[str]], texts: int = 1) -> str:
    """Return a table; its first `texts` columns are aligned to the left, as they hold no numbers.

    Args:
        head: names of the columns.
        rows: the cells.
    """
    rule = ["---"] * texts + ["---:"] * (len(head) - texts)
    return "\n".join("| " + " | ".join(cells) + " |" for cells in (head, rule, *rows))


def shown(score: dict[str, Any] | None, digits: int = 3) -> str:
    """Return a value with its interval, if it has one."""
    if score is None:
        return NOTHING
    value = f"{score['value']:.{digits}f}"
    if score.get("low") is None:
        return value
    return f"{value} [{score['low']:.{digits}f}, {score['high']:.{digits}f}]"


def put(path: Path, name: str, text: str) -> None:
    """Replace what stands between `<!-- name -->` and `<!-- end of name -->` in a page.

    Raises ValueError where the page lacks one of them.
    """
    page = path.read_text(encoding="utf-8")
    first, last = f"<!-- {name} -->", f"<!-- end of {name} -->"
    before, found, rest = page.partition(first)
    _, also, after = rest.partition(last)
    if not (found and also):
        raise ValueError(f"{path}: found no {first} ... {last}")
    write_text(path, f"{before}{first}\n\n{text}\n\n{last}{after}", overwrite=True)
