"""One table in four formats: text for terminals, Markdown, LaTeX, and HTML (by `page`).

Cells hold texts as they are. Each format escapes them, so that a name from a stranger's file stays
within its cell and does nothing else. The package tabulate lays out the columns.
"""

import itertools
import re
import textwrap
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

from tabulate import SEPARATING_LINE, DataRow, Line, TableFormat, tabulate

from scenegen.common.text_table import markdown, printable

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
    """

    value: str = "-"
    rest: str = ""
    best: bool = False

    def __str__(self) -> str:
        return " ".join(filter(None, (self.value, self.rest)))


@dataclass(frozen=True)
class Row:
    """Cells, one for each column.

    Attributes:
        kind: "" for an ordinary row. Rows of other kinds, such as "baseline", have their name in
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


def without_rests(table: Table) -> Table:
    """Return a table of values alone, without what follows them, such as intervals."""
    rows = (
        replace(row, cells=tuple(replace(cell, rest="") for cell in row.cells))
        for row in table.rows
    )
    return replace(table, rows=tuple(rows))


def to_text(
    title: str, tables: Iterable[Table], notes: Iterable[str] = (), width: int | None = None
) -> str:
    """Return tables with aligned columns, each below its title, and the notes, each once.

    Args:
        title: may have several lines.
        width: characters of a line. Notes are wrapped to it, and the heads of tables that are
            wider; columns that do not fit follow below, after those that name the rows. None wraps
            nothing.
    """
    parts = [[line for text in title.splitlines() for line in _wrapped(text, width)]]
    told = set[str]()
    for table in tables:
        rows = [[printable(str(cell)) for cell in row.cells] for row in table.rows]
        lines = _lines([[*table.head], *rows])
        if width is not None and max(map(len, lines)) + 2 > width:
            lines = _folded([_narrow(table.head, rows), *rows], table.named_by + 1, width - 2)
        below = [line for note in _once(table.notes, told) for line in _wrapped(note, width)]
        above = [printable(table.title)] if table.title else []
        parts.append([*above, *(f"  {line}".rstrip() for line in lines), *below])
    parts.append([line for note in _once(notes, told) for line in _wrapped(note, width)])
    return "\n\n".join("\n".join(lines) for lines in parts if lines)


def to_markdown(
    title: str, tables: Iterable[Table], notes: Iterable[str] = (), width: int | None = None
) -> str:
    """Return Markdown tables, with notes as lists, each note once; `width` does not count."""
    del width
    parts, told = list(map(_markdown, title.splitlines())), set[str]()
    for table in tables:
        rows = [
            [_markdown_cell(table, row, i) for i in range(len(row.cells))] for row in table.rows
        ]
        parts += [f"**{_markdown(table.title)}**"] if table.title else []
        parts.append(_layout(rows, [*map(_markdown, table.head)], "github"))
        parts.append("\n".join(f"- {_markdown(note)}" for note in _once(table.notes, told)))
    parts.append("\n".join(f"- {_markdown(note)}" for note in _once(notes, told)))
    return "\n\n".join(filter(None, parts))


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


def _layout(rows: Sequence[Sequence[str]], head: Sequence[str], form: str | TableFormat) -> str:
    return tabulate(rows, head, tablefmt=form, disable_numparse=True)


def _lines(rows: Sequence[Sequence[str]]) -> list[str]:
    return _layout(rows, (), "plain").splitlines()


def _folded(rows: Sequence[Sequence[str]], names: int, width: int) -> list[str]:
    """Return lines no wider than `width`, if columns allow: those that do not fit come below.

    Args:
        names: first columns that begin each block, as they name the rows.
    """
    count, lines = len(rows[0]), list[str]()
    start = names
    while start < count:
        stop, block = start, list[str]()
        while stop < count:
            wider = _lines([[*row[:names], *row[start : stop + 1]] for row in rows])
            if stop > start and max(map(len, wider)) > width:
                break
            stop, block = stop + 1, wider
        lines += [*([""] if lines else []), *block]
        start = stop
    return lines


def _narrow(head: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Return heads in lines no wider than their columns, where their words allow that."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)] if rows else []
    return [
        "\n".join(textwrap.wrap(text, max(width, 1), break_long_words=False))
        for text, width in zip(head, widths or [1] * len(head), strict=True)
    ]


def _once(notes: Iterable[str], told: set[str]) -> list[str]:
    """Return those notes that are not told yet, and take them for told."""
    new = [note for note in dict.fromkeys(notes) if note not in told]
    told.update(new)
    return new


def _wrapped(text: str, width: int | None) -> list[str]:
    """Return a text as lines of so many characters, where its words allow that."""
    line = printable(text)
    if width is None:
        return [line]
    return textwrap.wrap(
        line, max(width, 20), subsequent_indent="  ", break_long_words=False,
        break_on_hyphens=False,
    )  # fmt: skip


def _markdown(text: str) -> str:
    return markdown(printable(text))


def _markdown_cell(table: Table, row: Row, column: int) -> str:
    cell = row.cells[column]
    value = _markdown(cell.value)
    mark = "**" if cell.best else "*" if row.kind and column == table.named_by else ""
    return " ".join(filter(None, (f"{mark}{value}{mark}", _markdown(cell.rest))))


def _latex_lines(table: Table, label: str) -> Iterator[str]:
    yield from (r"\begin{table}", r"\centering", rf"\caption{{{latex(table.title)}}}")
    if label:
        yield rf"\label{{{label}}}"
    yield r"\resizebox{\ifdim\width>\linewidth\linewidth\else\width\fi}{!}{%"
    columns = "r" * table.named_by + "l" + "c" * (len(table.head) - table.named_by - 1)
    form = TableFormat(
        lineabove=Line(rf"\begin{{tabular}}{{{columns}}}" + "\n" + r"\toprule", "", "", ""),
        linebelowheader=Line(r"\midrule", "", "", ""),
        linebetweenrows=None,
        linebelow=Line("\\bottomrule\n\\end{tabular}}", "", "", ""),
        headerrow=DataRow("", " & ", r" \\"),
        datarow=DataRow("", " & ", r" \\"),
        padding=0,
        with_header_hide=None,
    )
    rows: list[list[str]] = []
    for _, alike in itertools.groupby(table.rows, lambda row: row.kind):
        rows += [[SEPARATING_LINE]] * bool(rows)
        rows += [[_latex_cell(table, row, i) for i in range(len(row.cells))] for row in alike]
    yield _layout(rows, [*map(latex, table.head)], form)
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
