"""The one kind of page, which holds everything it shows: texts, tables, charts and pictures.

All pages are filled into one template, which escapes whatever it shows.
"""

import base64
import functools
import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from metrics.views.examples import Example
from metrics.views.table import Table
from scenegen.common.text_table import printable

_TEMPLATES = Path(__file__).parent / "templates"


@dataclass(frozen=True)
class Section:
    """What stands under a heading, in this order.

    Attributes:
        remarks: sentences.
        tables: each with its title, unless that is the section's.
        examples: titles of lists, and their items with pictures.
        charts: titles, and SVG images as data URLs.
        notes: a list in small letters.
        folded: whether it opens at a click; its tables are printed all the same.
    """

    title: str = ""
    remarks: Sequence[str] = ()
    tables: Sequence[Table] = ()
    examples: Sequence[tuple[str, Sequence[Example]]] = ()
    charts: Sequence[tuple[str, str]] = ()
    notes: Sequence[str] = ()
    folded: bool = False


def html_page(
    title: str, sections: Sequence[Section], warnings: Sequence[str] = (), sortable: bool = False
) -> str:
    """Return a page that asks for nothing: `warnings` first, then the sections.

    A section without a title belongs to what stands first.

    The Content-Security-Policy of the page allows the pictures that it holds and its one style
    sheet, by SHA-256, and no other style, no script, frame, form or request. With `sortable` it
    also allows the one script that sorts tables, by SHA-256.
    """
    style = "\n" + (_TEMPLATES / "style.css").read_text(encoding="utf-8")
    script = "\n" + (_TEMPLATES / "sort.js").read_text(encoding="utf-8") if sortable else ""
    policy = (
        f"default-src 'none'; style-src '{_digest(style)}'; img-src data:;"
        " base-uri 'none'; form-action 'none'"
    )
    policy += f"; script-src '{_digest(script)}'" if script else ""
    page: str = _template().render(
        title=title, sections=sections, warnings=warnings, policy=policy,
        style=Markup(style), script=Markup(script),
    )  # fmt: skip
    return page


def _digest(text: str) -> str:
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()


@functools.cache
def _template() -> Any:
    environment = Environment(
        loader=FileSystemLoader(_TEMPLATES, encoding="utf-8"),
        autoescape=True,
        finalize=_shown,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    return environment.get_template("page.html")


def _shown(value: Any) -> Any:
    """Return what the template prints, control characters of texts as escapes; markup as it is."""
    is_text = isinstance(value, str) and not isinstance(value, Markup)
    return printable(value, keep="\n\t") if is_text else value
