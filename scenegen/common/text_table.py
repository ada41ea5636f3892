"""Names and numbers as cells of tables: for terminals, Markdown, HTML and LaTeX.

Names come from others' files: whatever they hold, they stay one cell and show as they are.
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
    """A name in one line, of characters that show; "(unnamed)" where there are none."""
    kept = "".join(
        c if c.isspace() or _shows(c) else "\ufffd" for c in name if c not in _DIRECTIONS
    )
    line = " ".join(kept.split()) or UNNAMED
    return line if len(line) <= LONGEST else line[: LONGEST - 3] + "..."


def _shows(character: str) -> bool:
    return unicodedata.category(character) not in _CONTROLS


def markdown(text: str) -> str:
    """A text in one line as a Markdown cell that shows it."""
    return "".join(_MARKDOWN.get(c, c) for c in text)


def html(text: str) -> str:
    """A text as HTML that shows it, within elements and quoted attributes."""
    return html_module.escape(text, quote=True)


def latex(text: str) -> str:
    """A text as LaTeX that shows it, given textcomp."""
    escaped = "".join(_LATEX.get(c, c) for c in text)
    return re.sub("-(?=-)", "-{}", escaped)  # else hyphens become a dash


def distinct(names: Sequence[str], hints: Sequence[str]) -> list[str]:
    """Names in one line each, told apart: by their hints where two are alike, else by number."""
    found = [plain(name) for name in names]
    hinted = [
        f"{name} [{plain(hint)}]" if found.count(name) > 1 else name
        for name, hint in zip(found, hints, strict=True)
    ]
    return [f"{name} #{i + 1}" if hinted.count(name) > 1 else name for i, name in enumerate(hinted)]


def number(value: float, like: float | None = None) -> str:
    """A number with 4 significant digits, without exponent where 8 decimals hold it.

    With `like`, as many decimals as that number is shown with.
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
    """Rows of equal length as lines, columns aligned."""
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
    """Rows as the lines of a Markdown table, the first as its head; cells escaped already."""
    head, *rest = ["| " + " | ".join(row) + " |" for row in rows]
    return [head, "| " + " | ".join("---" for _ in rows[0]) + " |", *rest]
