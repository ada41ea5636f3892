"""Tables in Markdown, and their places in a page, between two comments each."""

from collections.abc import Sequence
from pathlib import Path

from scenegen.files.new_file import write_text

NOTHING = "–"


def table(head: Sequence[str], rows: Sequence[Sequence[str]], texts: int = 1) -> str:
    """Return a table; its first `texts` columns hold no numbers and are aligned to the left.

    Args:
        head: names of the columns.
        rows: the cells.
    """
    rule = ["---"] * texts + ["---:"] * (len(head) - texts)
    return "\n".join("| " + " | ".join(cells) + " |" for cells in (head, rule, *rows))


def put(path: Path, name: str, text: str) -> None:
    """Replace what stands between `<!-- name -->` and `<!-- end of name -->` in a page.

    Raises ValueError where the page lacks one of them.
    """
    page = path.read_text(encoding="utf-8")
    first, last = f"<!-- {name} -->", f"<!-- end of {name} -->"
    if first not in page or last not in page:
        raise ValueError(f"{path}: {first} or {last} is missing")
    before, after = page.partition(first)[0], page.partition(last)[2]
    write_text(path, f"{before}{first}\n\n{text}\n\n{last}{after}", overwrite=True)
