"""Names and numbers as cells of tables: for terminals, Markdown, HTML and LaTeX.

Names come from files of other people. Whatever characters they hold, a name stays one cell of one
line and is shown as it is.
"""

import html as html_module
import math
import re
import unicodedata
from collections.abc import Sequence

DIGITS = 4  # significant ones of a score
LONGEST = 60  # characters of a name
UNNAMED = "(unnamed)"
_CONTROLS = ("Cc", "Cs", "Cn", "Co", "Zl", "Zp")
_DIRECTIONS = frozenset("\u061c\u200e\u200f\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069")
_MARKDOWN = {c: f"\\{c}" for c in "\\`*_[]|~$"} | {"&": "&amp;", "<": "&lt;", ">": "&gt;"}
_LATEX = {c: f"\\{c}" for c in "&%$#_{}"} | {
    "\\": r"\textbackslash{}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
    "|": r"\textbar{}",
    '"': r"{\char34}",
    "`": r"\textasciigrave{}",
    "'": r"\textquotesingle{}",
    "°": r"\textdegree{}",
    "↑": r"\ensuremath{\uparrow}",
    "↓": r"\ensuremath{\downarrow}",
    "±": r"\ensuremath{\pm}",
    "†": r"\textdagger{}",
    "‡": r"\textdaggerdbl{}",
}


def plain(name: str) -> str:
    """Return a name as one line of visible characters, "(unnamed)" if it has none."""
    kept = "".join(
        c if c.isspace() or _shows(c) else "\ufffd" for c in name if c not in _DIRECTIONS
    )
    line = " ".join(kept.split()) or UNNAMED
    return line if len(line) <= LONGEST else line[: LONGEST - 3] + "..."


def _shows(character: str) -> bool:
    return unicodedata.category(character) not in _CONTROLS


def markdown(text: str) -> str:
    """Return a text of one line as a Markdown cell that shows it."""
    return "".join(_MARKDOWN.get(c, c) for c in text)


def html(text: str) -> str:
    """Return a text as HTML that shows it, within elements and quoted attributes."""
    return html_module.escape(text, quote=True)


def latex(text: str) -> str:
    """Return a text as LaTeX that shows it; the document must load textcomp."""
    escaped = "".join(_LATEX.get(c, c) for c in text)
    return re.sub("-(?=-)", "-{}", escaped)  # else hyphens become a dash


def distinct(names: Sequence[str], hints: Sequence[str]) -> list[str]:
    """Return names as one line each; equal ones get their hint, or else a number, to differ."""
    found = [plain(name) for name in names]
    hinted = [
        f"{name} [{plain(hint)}]" if found.count(name) > 1 else name
        for name, hint in zip(found, hints, strict=True)
    ]
    return [f"{name} #{i + 1}" if hinted.count(name) > 1 else name for i, name in enumerate(hinted)]


def number(value: float, like: float | None = None) -> str:
    """Return a number with 4 significant digits, without exponent where 8 decimals suffice.

    With `like`, it gets as many decimals as that number would.
    """
    scale = abs(value if like is None or like == 0.0 else like)
    if value == 0.0 and scale == 0.0:
        return "0"
    if not 1e-5 <= scale < 1e6 or abs(value) >= 1e6:
        return f"{value:.{DIGITS}g}"
    decimals = min(max(DIGITS - 1 - math.floor(math.log10(scale)), 0), 8)
    text = f"{value:.{decimals}f}"
    return text.removeprefix("-") if float(text) == 0.0 else text


def aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    """Return rows of equal length as lines of text with aligned columns."""
    widths = [max(map(_width, column)) for column in zip(*rows, strict=True)]
    return [
        "  ".join(
            cell + " " * (width - _width(cell)) for cell, width in zip(row, widths, strict=True)
        ).rstrip()
        for row in rows
    ]


def _width(text: str) -> int:
    wide = sum(unicodedata.east_asian_width(c) in "WF" for c in text)
    return len(text) + wide - sum(unicodedata.combining(c) > 0 for c in text)


def piped(rows: Sequence[Sequence[str]]) -> list[str]:
    """Return rows of escaped cells as the lines of a Markdown table; the first is its head."""
    head, *rest = ["| " + " | ".join(row) + " |" for row in rows]
    return [head, "| " + " | ".join("---" for _ in rows[0]) + " |", *rest]
