"""A leaderboard as Markdown, as a self-contained HTML page, and as LaTeX tables (booktabs)."""

import re
from collections.abc import Sequence

from metrics.leaderboard.table import Cell, Table
from metrics.report.html import render
from scenegen.common.text_table import laid_out, markdown

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


def to_markdown(tables: Sequence[Table]) -> str:
    """Return Markdown tables with their notes as lists."""
    lines: list[str] = []
    for table in tables:
        rows = [["#", "method", *map(markdown, table.columns)]]
        for row in table.rows:
            label = markdown(row.label) if row.kind == "ranked" else f"*{markdown(row.label)}*"
            rows.append([row.rank, label, *map(_markdown_cell, row.cells)])
        lines += laid_out([(markdown(table.title), rows)], as_markdown=True)
        lines += ["", *(f"- {markdown(note)}" for note in table.notes)]
    return "\n".join(lines[1:]) + "\n"


def _markdown_cell(cell: Cell) -> str:
    value = f"**{markdown(cell.value)}**" if cell.best else markdown(cell.value)
    return value + markdown(cell.rest)


def to_html(tables: Sequence[Table]) -> str:
    """Return one page that loads nothing and runs no scripts."""
    return render("leaderboard.html", tables=tables)


def to_latex(tables: Sequence[Table]) -> str:
    """Return LaTeX tables, after a comment that names the packages they need."""
    text = "\n\n".join(map(_latex_table, tables))
    note = "" if text.isascii() else "; names are not all ASCII: XeLaTeX or LuaLaTeX shows them"
    return f"% needs \\usepackage{{booktabs,graphicx,textcomp}}{note}\n{text}\n"


def latex(text: str) -> str:
    """Escape one line of text so that LaTeX, with the package textcomp, shows it unchanged."""
    escaped = "".join(_LATEX.get(c, c) for c in text)
    return re.sub("-(?=-)", "-{}", escaped)  # two hyphens in a row would become a dash


def _latex_table(table: Table) -> str:
    lines = [
        r"\begin{table}",
        r"\centering",
        rf"\caption{{{latex(table.title)}}}",
        r"\resizebox{\ifdim\width>\linewidth\linewidth\else\width\fi}{!}{%",
        rf"\begin{{tabular}}{{rl{'c' * len(table.columns)}}}",
        r"\toprule",
        _latex_row(["\\#", "method", *map(latex, table.columns)]),
    ]
    for part in table.parts:
        lines.append(r"\midrule")
        for row in part:
            label = latex(row.label) if row.kind == "ranked" else rf"\emph{{{latex(row.label)}}}"
            lines.append(_latex_row([row.rank, label, *map(_latex_cell, row.cells)]))
    lines += [r"\bottomrule", r"\end{tabular}}"]
    lines += [rf"\par\footnotesize {latex(note)}" for note in table.notes]
    return "\n".join([*lines, r"\end{table}"])


def _latex_row(cells: Sequence[str]) -> str:
    return " & ".join(cells) + r" \\"


def _latex_cell(cell: Cell) -> str:
    value = rf"\textbf{{{latex(cell.value)}}}" if cell.best else latex(cell.value)
    return value + latex(cell.rest)
