"""HTML pages from the templates of this folder; whatever a page shows is escaped."""

from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from scenegen.common.text_table import printable


def _shown(value: Any) -> Any:
    """Return what a template prints, control characters of texts as escapes; markup as it is."""
    plain = isinstance(value, str) and not isinstance(value, Markup)
    return printable(value, keep="\n\t") if plain else value


_PAGES = Environment(
    loader=FileSystemLoader(Path(__file__).parent / "templates", encoding="utf-8"),
    autoescape=True,
    finalize=_shown,
    undefined=StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
    keep_trailing_newline=True,
)


def render(template: str, **values: Any) -> str:
    """Return a page that loads nothing: `templates/<template>`, filled with these values.

    Texts are escaped unless they are `markupsafe.Markup`. A name that the template uses and
    `values` lacks raises jinja2.UndefinedError.
    """
    return _PAGES.get_template(template).render(**values)
