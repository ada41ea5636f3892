"""The pages as HTML, from the templates of this folder; they load nothing but their own files."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from iqtt.questions.specs import LETTERS

FOLDER = Path(__file__).parent
STATIC = FOLDER / "static"
_PAGES = Environment(
    loader=FileSystemLoader(FOLDER / "templates", encoding="utf-8"),
    autoescape=True,
    undefined=StrictUndefined,
    auto_reload=False,
    trim_blocks=True,
    lstrip_blocks=True,
)
_PAGES.globals["letters"] = LETTERS


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
