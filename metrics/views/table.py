"""One table in four formats: text for terminals, Markdown, LaTeX, and HTML (by `page`).

Cells hold texts as they are. Each format escapes them, so that a name from a stranger's file stays
within its cell and does nothing else.
"""

import itertools
import re
import textwrap
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

from scenegen.common.text_table import aligned, markdown, piped, printable

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
    "≈": r"\ensuremath{\approx}",
    "†": r"\textdagger{}",
    "‡": r"\textdaggerdbl{}",
}


@dataclass(frozen=True)
class Cell:
    """A value and what follows it.

    Attributes:
        value: such as "0.1234"; "-" where there is none.
        rest: what follows in small letters, such as "± 0.01 [0.10, 0.15]"; or empty.
        best: whether the value is bold.
        drawing: a picture before the value on pages, as a data URL; or empty.
        link: address that the value leads to; or empty.
    """

    value: str = "-"
    rest: str = ""
    best: bool = False
    drawing: str = ""
    link: str = ""

    def __str__(self) -> str:
        return " ".join(filter(None, (self.value, self.rest)))


@dataclass(frozen=True)
class Row:
    """Cells, one for each column.

    Attributes:
        kind: "" for an ordinary row. Rows of other kinds, such as "floor", have their name in
            italics, and LaTeX has a line between kinds.
    """

    cells: tuple[Cell, ...]
    kind: str = ""


@dataclass(frozen=True)
class Table:
    """Rows under a head, with a title and notes below.

    Attributes:
        named_by: number of the column that names each row.
    """

    title: str
    head: tuple[str, ...]
    rows: tuple[Row, ...]
    notes: tuple[str, ...] = ()
    named_by: int = 0


def make_row(cells: Iterable[Cell | str], kind: str = "") -> Row:
    """Return a row of cells, of which those without anything but a value are texts."""
    return Row(tuple(c if isinstance(c, Cell) else Cell(c) for c in cells), kind)


def make_table(title: str, head: Sequence[str], rows: Iterable[Iterable[Cell | str]]) -> Table:
    """Return a table of ordinary rows."""
    return Table(title, tuple(head), tuple(map(make_row, rows)))


def to_text(
    title: str, tables: Iterable[Table], notes: Iterable[str] = (), width: int | None = None
) -> str:
    """Return tables with aligned columns, each below its title, and the notes, each once.

    Args:
        width: characters of a line. Notes are wrapped to it, and the heads of tables that are
            wider; without it nothing is.
    """
    lines, told = [title] if title else [], set[str]()
    for table in tables:
        rows = [[printable(str(cell)) for cell in row.cells] for row in table.rows]
        shown = aligned([table.head, *rows])
        if width is not None and max(map(len, shown)) + 2 > width:
            shown = aligned([*_narrow_head(table.head, rows), *rows])
        lines += ["", *filter(None, [table.title])]
        lines += ["  " + line for line in shown]
        lines += [line for n in _once(table.notes, told) for line in _wrapped(n, width)]
    text = [*lines, "", *(line for n in _once(notes, told) for line in _wrapped(n, width))]
    return "\n".join(map(printable, text)).strip("\n")


def to_markdown(
    title: str, tables: Iterable[Table], notes: Iterable[str] = (), width: int | None = None
) -> str:
    """Return Markdown tables, with notes as lists, each note once; `width` is as in `to_text`."""
    parts, told = [_markdown(title)] if title else [], set[str]()
    for table in tables:
        rows = [
            [_markdown_cell(table, row, i) for i in range(len(row.cells))] for row in table.rows
        ]
        parts += [f"**{_markdown(table.title)}**"] if table.title else []
        parts.append("\n".join(piped([[*map(_markdown, table.head)], *rows])))
        parts.append(_listed(table.notes, told, width))
    return "\n\n".join(filter(None, [*parts, _listed(notes, told, width)]))


def _once(notes: Iterable[str], told: set[str]) -> list[str]:
    """Return those notes that are not told yet, and take them for told."""
    new = [note for note in dict.fromkeys(notes) if note not in told]
    told.update(new)
    return new


def _wrapped(text: str, width: int | None, first: str = "", rest: str = "") -> list[str]:
    """Return a text as lines of so many characters, where its words allow that.

    No line but the first begins with what Markdown would take for a list or a heading.
    """
    if width is None:
        return [first + text]
    lines = textwrap.wrap(
        text, max(width, 20), initial_indent=first, subsequent_indent=rest,
        break_long_words=False, break_on_hyphens=False,
    )  # fmt: skip
    safe: list[str] = []
    for line in lines:
        if safe and re.match(r"[-+*#>=~|]|[0-9]+[.)]", line.strip()):
            safe[-1] += f" {line.strip()}"
        else:
            safe.append(line)
    return safe or [first]


def _narrow_head(head: Sequence[str], rows: Sequence[Sequence[str]]) -> list[list[str]]:
    """Return lines of heads that are no wider than their columns, where their words allow that."""
    widths = (
        [max(map(len, column)) for column in zip(*rows, strict=True)] if rows else [0] * len(head)
    )
    lines = [
        textwrap.wrap(text, max(width, 1), break_long_words=False) or [""]
        for text, width in zip(head, widths, strict=True)
    ]
    most = max(map(len, lines))
    padded = [[""] * (most - len(one)) + one for one in lines]
    return [list(line) for line in zip(*padded, strict=True)]


def _markdown(text: str) -> str:
    return markdown(printable(text))


def _markdown_cell(table: Table, row: Row, column: int) -> str:
    cell = row.cells[column]
    value = _markdown(cell.value)
    mark = "**" if cell.best else "*" if row.kind and column == table.named_by else ""
    return " ".join(filter(None, (f"{mark}{value}{mark}", _markdown(cell.rest))))


def _listed(notes: Iterable[str], told: set[str], width: int | None) -> str:
    new = (_markdown(note) for note in _once(notes, told))
    return "\n".join(line for note in new for line in _wrapped(note, width, "- ", "  "))


def without_rests(table: Table) -> Table:
    """Return a table of values alone, without what follows them, such as intervals."""
    rows = (
        replace(row, cells=tuple(replace(cell, rest="") for cell in row.cells))
        for row in table.rows
    )
    return replace(table, rows=tuple(rows))


def to_latex(tables: Iterable[Table], label: str = "") -> str:
    r"""Return LaTeX tables (booktabs), after a comment that names the packages they need.

    Args:
        label: of the first table, for \ref; a number follows it for each other one.
    """
    labels = (f"{label}-{i}" if label and i > 1 else label for i in itertools.count(1))
    text = "\n\n".join(
        "\n".join(_latex_lines(table, name)) for table, name in zip(tables, labels, strict=False)
    )
    note = "" if text.isascii() else "; names are not all ASCII: XeLaTeX or LuaLaTeX shows them"
    return f"% needs \\usepackage{{booktabs,graphicx,textcomp}}{note}\n{text}"


def latex(text: str) -> str:
    """Escape one line of text so that LaTeX, with the package textcomp, shows it unchanged."""
    escaped = "".join(_LATEX.get(c, c) for c in printable(text))
    return re.sub("-(?=-)", "-{}", escaped)  # two hyphens in a row would become a dash


def _latex_lines(table: Table, label: str) -> Iterator[str]:
    yield from (r"\begin{table}", r"\centering", rf"\caption{{{latex(table.title)}}}")
    if label:
        yield rf"\label{{{label}}}"
    yield r"\resizebox{\ifdim\width>\linewidth\linewidth\else\width\fi}{!}{%"
    columns = "r" * table.named_by + "l" + "c" * (len(table.head) - table.named_by - 1)
    yield from (rf"\begin{{tabular}}{{{columns}}}", r"\toprule")
    yield " & ".join(map(latex, table.head)) + r" \\"
    for _, rows in itertools.groupby(table.rows, lambda row: row.kind):
        yield r"\midrule"
        for row in rows:
            yield " & ".join(_latex_cell(table, row, i) for i in range(len(row.cells))) + r" \\"
    yield from (r"\bottomrule", r"\end{tabular}}")
    yield from (rf"\par\footnotesize {latex(note)}" for note in table.notes)
    yield r"\end{table}"


def _latex_cell(table: Table, row: Row, column: int) -> str:
    cell = row.cells[column]
    value = latex(cell.value)
    if cell.best:
        value = rf"\textbf{{{value}}}"
    elif row.kind and column == table.named_by:
        value = rf"\emph{{{value}}}"
    return " ".join(filter(None, (value, latex(cell.rest))))
