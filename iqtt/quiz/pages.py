"""The pages as HTML, from the templates of this folder; they load nothing but their own files."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

FOLDER = Path(__file__).parent
TYPES = {".css": "text/css", ".js": "text/javascript", ".svg": "image/svg+xml"}
_PAGES = Environment(
    loader=FileSystemLoader(FOLDER / "templates", encoding="utf-8"),
    autoescape=True,
    undefined=StrictUndefined,
    auto_reload=False,
    trim_blocks=True,
    lstrip_blocks=True,
)


@dataclass(frozen=True)
class Bar:
    """A line of the comparison at the end: fractions of right answers, and their 95% interval.

    Attributes:
        low, high: ends of the interval, or None.
        note: where the figure comes from.
        own: whether it is the participant's.
    """

    name: str
    value: float
    low: float | None
    high: float | None
    note: str
    own: bool = False


def page(template: str, **values: Any) -> str:
    """Return a page: `templates/<template>.html`, filled with these values, which are escaped."""
    return _PAGES.get_template(f"{template}.html").render(**values)


def result_page(right: int, count: int, bars: Sequence[Bar]) -> str:
    """Return the page at the end, with the own score beside others."""
    return page("result", right=right, count=count, bars=bars, own=bars[0])


@cache
def static_files() -> dict[str, tuple[bytes, str]]:
    """Return content and type of each file that pages load, by its name: there are no others."""
    return {
        path.name: (path.read_bytes(), TYPES[path.suffix])
        for path in sorted((FOLDER / "static").iterdir())
        if path.suffix in TYPES
    }
