"""Tables of names and numbers as text, for terminals and as Markdown.

Names come from other people's files. Whatever a name holds, it stays within one cell, and what
cannot be shown in it becomes an escape.
"""

import math
import unicodedata
from collections.abc import Iterable, Sequence

from tabulate import tabulate

NOTHING = 1e-9  # what is smaller comes from rounding
DIGITS = 4  # significant digits of a score
LONGEST = 60  # characters of a name
UNNAMED = "(unnamed)"
Rows = Sequence[Sequence[str]]
Interval = tuple[float | None, float | None]
_HIDDEN_CATEGORIES = ("Cc", "Cs", "Cn", "Co", "Zl", "Zp")
_TEXT_DIRECTIONS = frozenset(
    "\u061c\u200e\u200f\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069"
)
_MARKDOWN = {c: f"\\{c}" for c in "\\`*_[]|~$"} | {"&": "&amp;", "<": "&lt;", ">": "&gt;"}


def printable(text: str, keep: str = "") -> str:
    r"""Return a text as one line that can do nothing to a terminal, nor pass for several lines.

    Characters that cannot be shown, that turn the direction of the text or that end a line become
    escapes such as \x1b, except those of `keep`. Nothing is shortened.
    """
    return "".join(
        c.encode("unicode_escape").decode() if _hidden(c) and c not in keep else c for c in text
    )


def plain(name: str) -> str:
    """Return a name as `printable` shows it, its white space as single spaces, in 60 characters.

    A name of nothing but white space becomes "(unnamed)".
    """
    line = printable(" ".join(name.split())) or UNNAMED
    return line if len(line) <= LONGEST else line[: LONGEST - 3] + "..."


def _hidden(c: str) -> bool:
    return c in _TEXT_DIRECTIONS or unicodedata.category(c) in _HIDDEN_CATEGORIES


def markdown(text: str) -> str:
    """Escape one line of text so that a Markdown table shows it unchanged within one cell."""
    return "".join(_MARKDOWN.get(c, c) for c in text)


def distinct(names: Sequence[str], hints: Sequence[str]) -> list[str]:
    """Return each name as one line, different from all others.

    Equal names get their hints in brackets; names that are equal even then are numbered.
    """
    shown = [plain(name) for name in names]
    hinted = [
        f"{name} [{plain(hint)}]" if shown.count(name) > 1 else name
        for name, hint in zip(shown, hints, strict=True)
    ]
    return [f"{name} #{i + 1}" if hinted.count(name) > 1 else name for i, name in enumerate(hinted)]


def by_number(keys: Iterable[str]) -> list[str]:
    """Sort keys by the number that they begin with: "30-60" stands before "120-150".

    Keys that begin with no number follow in alphabetical order.
    """

    def place(key: str) -> tuple[float, str]:
        first = key.partition("-")[0]
        return (float(first) if first.isdecimal() else math.inf, key)

    return sorted(keys, key=place)


def number(value: float, interval: Interval = (None, None)) -> str:
    """Return a number with as many decimals as an interval supports, its own or a neighbour's.

    Half of the interval is 2 to 20 units of the last decimal: 0.60 [0.54, 0.64]. Without an
    interval, or with one of no width, there are 4 significant digits. There is no exponent where 8
    decimals hold the number.
    """
    low, high = interval
    half = 0.0 if low is None or high is None else (high - low) / 2
    largest = max(abs(value), half)
    if largest < NOTHING:
        return "0"
    if not 1e-5 <= largest < 1e6:
        return f"{value:.{DIGITS}g}"
    is_wide = half > 1e-6 * largest
    last = half / 2 if is_wide else largest / 10 ** (DIGITS - 1)
    decimals = min(max(-math.floor(math.log10(last)), 0), 8)
    text = f"{value:.{decimals}f}"
    return text.removeprefix("-") if float(text) == 0.0 else text


def with_interval(value: float, low: float | None, high: float | None) -> tuple[str, str]:
    """Return a number and its interval as text; "-" stands for no interval."""
    if low is None or high is None:
        return number(value), "-"
    return number(value, (low, high)), f"[{number(low, (low, high))}, {number(high, (low, high))}]"


def aligned(rows: Rows) -> list[str]:
    """Return rows of equal length as lines whose columns are aligned in a terminal."""
    text = tabulate(rows, tablefmt="plain", disable_numparse=True, preserve_whitespace=True)
    return [line.rstrip() for line in text.splitlines()]


def piped(rows: Rows) -> list[str]:
    """Return the lines of a Markdown table with the first row as its head.

    The cells have to be escaped already, with `markdown`.
    """
    head, *rest = ["| " + " | ".join(row) + " |" for row in rows]
    return [head, "| " + " | ".join("---" for _ in rows[0]) + " |", *rest]
