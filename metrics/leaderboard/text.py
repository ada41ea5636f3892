"""A leaderboard as Markdown, as one self-contained HTML page, and as LaTeX tables (booktabs)."""

from collections.abc import Sequence

from metrics.leaderboard.leaderboard import Leaderboard
from metrics.leaderboard.table import Cell, Row, Table
from scenegen.common.text_table import html, latex, markdown, piped

_STYLE = """
:root { color-scheme: light dark; }
body { font: 15px/1.45 system-ui, sans-serif; }
body { margin: 2rem auto; max-width: 70rem; padding: 0 1rem; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; margin: 0.5rem 0; }
caption { text-align: left; font-weight: 600; padding: 0.4rem 0; }
th, td { padding: 0.25rem 0.7rem; text-align: right; font-variant-numeric: tabular-nums; }
th:nth-child(2), td:nth-child(2) { text-align: left; font-weight: normal; }
thead th { border-bottom: 2px solid; font-weight: 600; }
td small { opacity: 0.75; white-space: nowrap; }
.best { font-weight: 700; }
.incomparable, .reported { opacity: 0.75; font-style: italic; }
tr.first > * { border-top: 1px solid; }
.notes { margin: 0 0 2rem; padding-left: 1.2rem; font-size: 0.9em; }
""".strip()
_CLASSES = {"ranked": "ranked", "not comparable": "incomparable", "reported": "reported"}
_PREAMBLE = "% needs \\usepackage{booktabs,graphicx,textcomp}"


def to_markdown(board: Leaderboard) -> str:
    """Return Markdown tables."""
    parts = []
    for table in board.tables:
        head = ["#", "method", *map(markdown, table.columns)]
        rows = [[row.rank, _emphasis(row), *map(_markdown_cell, row.cells)] for row in table.rows]
        notes = [f"- {markdown(note)}" for note in table.notes]
        parts.append(
            "\n".join([f"**{markdown(table.title)}**", "", *piped([head, *rows]), "", *notes])
        )
    return "\n\n".join(parts) + "\n"


def _emphasis(row: Row) -> str:
    label = markdown(row.label)
    return label if row.kind == "ranked" else f"*{label}*"


def _markdown_cell(cell: Cell) -> str:
    value = f"**{markdown(cell.value)}**" if cell.best else markdown(cell.value)
    return value + markdown(_rest(cell))


def _rest(cell: Cell) -> str:
    spread = f" ± {cell.spread}" if cell.spread else ""
    return f"{spread} {cell.interval}".rstrip()


def to_html(board: Leaderboard) -> str:
    """Return one page that needs nothing else, without scripts."""
    tables = "\n".join(map(_html_table, board.tables))
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>Leaderboard</title>\n<style>\n{_STYLE}\n</style>\n</head>\n<body>\n"
        f"<h1>Leaderboard</h1>\n{tables}\n</body>\n</html>\n"
    )


def _html_table(table: Table) -> str:
    head = "".join(f'<th scope="col">{html(text)}</th>' for text in ("#", "method", *table.columns))
    lines = [f'<div class="wide"><table>\n<caption>{html(table.title)}</caption>']
    lines.append(f"<thead><tr>{head}</tr></thead>\n<tbody>")
    for row, first in zip(table.rows, _firsts(table.rows), strict=True):
        names = _CLASSES[row.kind] + (" first" if first else "")
        cells = "".join(map(_html_cell, row.cells))
        label = f'<th scope="row"><bdi>{html(row.label)}</bdi></th>'
        lines.append(f'<tr class="{names}"><td>{html(row.rank)}</td>{label}{cells}</tr>')
    notes = "".join(f"<li>{html(note)}</li>" for note in table.notes)
    return "\n".join([*lines, f'</tbody></table></div>\n<ul class="notes">{notes}</ul>'])


def _html_cell(cell: Cell) -> str:
    opening = '<td class="best">' if cell.best else "<td>"
    rest = _rest(cell)
    return opening + html(cell.value) + (f"<small>{html(rest)}</small>" if rest else "") + "</td>"


def to_latex(board: Leaderboard) -> str:
    """Return LaTeX tables."""
    text = "\n\n".join(map(_latex_table, board.tables))
    note = "" if text.isascii() else "; names are not all ASCII: XeLaTeX or LuaLaTeX shows them"
    return f"{_PREAMBLE}{note}\n{text}\n"


def _latex_table(table: Table) -> str:
    lines = [
        r"\begin{table}",
        r"\centering",
        rf"\caption{{{latex(table.title)}}}",
        r"\resizebox{\ifdim\width>\linewidth\linewidth\else\width\fi}{!}{%",
        rf"\begin{{tabular}}{{rl{'c' * len(table.columns)}}}",
        r"\toprule",
        _latex_row(["\\#", "method", *map(latex, table.columns)]),
        r"\midrule",
    ]
    for row, first in zip(table.rows, _firsts(table.rows), strict=True):
        label = latex(row.label)
        label = label if row.kind == "ranked" else rf"\emph{{{label}}}"
        lines += [r"\midrule"] if first else []
        lines.append(_latex_row([row.rank, label, *map(_latex_cell, row.cells)]))
    lines += [r"\bottomrule", r"\end{tabular}}"]
    lines += [rf"\par\footnotesize {latex(note)}" for note in table.notes]
    return "\n".join([*lines, r"\end{table}"])


def _latex_row(cells: Sequence[str]) -> str:
    return " & ".join(cells) + r" \\"


def _latex_cell(cell: Cell) -> str:
    value = rf"\textbf{{{latex(cell.value)}}}" if cell.best else latex(cell.value)
    return value + latex(_rest(cell))


def _firsts(rows: Sequence[Row]) -> list[bool]:
    """Which rows begin another kind than the row before."""
    return [i > 0 and row.kind != rows[i - 1].kind for i, row in enumerate(rows)]
