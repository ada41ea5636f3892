"""HTML pages from the templates of this folder; whatever a page shows is escaped."""

import base64
import hashlib
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from scenegen.common.text_table import printable

LONGEST_WORD = 24  # letters
_TEMPLATES = Path(__file__).parent / "templates"


def _shown(value: Any) -> Any:
    """Return what a template prints, control characters of texts as escapes; markup as it is."""
    plain = isinstance(value, str) and not isinstance(value, Markup)
    return printable(value, keep="\n\t") if plain else value


def _has_long_word(text: str) -> bool:
    """Return whether a text has a word so long that a table must be allowed to break it."""
    return any(len(word) > LONGEST_WORD for word in text.split())


_PAGES = Environment(
    loader=FileSystemLoader(_TEMPLATES, encoding="utf-8"),
    autoescape=True,
    finalize=_shown,
    undefined=StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
    keep_trailing_newline=True,
)
_PAGES.tests["unbroken"] = _has_long_word


def render(template: str, **values: Any) -> str:
    """Return a page that loads nothing: `templates/<template>`, filled with these values.

    Its Content-Security-Policy allows pictures that it holds itself and its one style sheet, by
    SHA-256, and no script, style, frame, form or request. Texts are escaped unless they are
    `markupsafe.Markup`. A name that the template uses and `values` lacks raises
    jinja2.UndefinedError.
    """
    style = "\n" + (_TEMPLATES / "style.css").read_text(encoding="utf-8")
    digest = base64.b64encode(hashlib.sha256(style.encode()).digest()).decode()
    policy = (
        f"default-src 'none'; style-src 'sha256-{digest}'; img-src data:;"
        " base-uri 'none'; form-action 'none'"
    )
    return _PAGES.get_template(template).render(style=Markup(style), policy=policy, **values)
