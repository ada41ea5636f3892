"""Paired tests of a ranking: does each method differ from the one that stands first?"""

from collections.abc import Sequence
from dataclasses import replace

from metrics.comparison.compare import Comparison, compare
from metrics.comparison.pairing import ComparisonError
from metrics.leaderboard.table import Cell, Row, Table
from metrics.scoring.metric_names import HEADLINE
from metrics.scoring.records import ScoreFile

ALIKE = "≈"  # stands behind scores that are not told apart from those of the first method
NOTE = (
    f"{ALIKE} not told apart from the first method in this score: paired test over the same items,"
    " corrected for all scores and methods of the table, at 5%. Skills have no test of their own."
)
Verdicts = dict[tuple[int, str], str]  # by the id of a score file and the name of a score


def compared_with_first(files: Sequence[ScoreFile]) -> tuple[Comparison | None, Verdicts]:
    """Return the comparison of ranked files with the first one, and its verdicts.

    Files that lack a score that the first one has, or cannot be paired with it, are left out;
    without any other there is no comparison.
    """
    ranked = [file for file in files if file.comparable]
    if not ranked:
        return None, {}
    first = ranked[0]
    names = [name for name in HEADLINE[first.task] if name in first.metrics and name in first.items]
    paired = [first]
    paired += [file for file in ranked[1:] if _pairs(first, file, names)]
    if len(paired) < 2 or not names:
        return None, {}
    found = compare(paired, names)
    by_label = dict(zip(found.methods, paired[1:], strict=True))
    return found, {(id(by_label[d.method]), d.metric): d.verdict for d in found.differences}


def _pairs(first: ScoreFile, file: ScoreFile, names: Sequence[str]) -> bool:
    if not all(name in file.items for name in names):
        return False
    try:
        compare([first, file], names, resamples=100)
    except ComparisonError:
        return False
    return True


def marked(table: Table, verdicts: Verdicts) -> Table:
    """Return a ranking with marks at the scores that are not told apart from the first method's."""
    rows = tuple(_marked_row(table, row, verdicts) for row in table.rows)
    return replace(table, rows=rows, notes=(*table.notes, *([NOTE] if rows != table.rows else [])))


def _marked_row(table: Table, row: Row, verdicts: Verdicts) -> Row:
    def mark(key: str, cell: Cell) -> Cell:
        alike = verdicts.get((id(row.file), key)) == "not shown"
        return replace(cell, value=f"{cell.value} {ALIKE}") if alike else cell

    cells = (mark(key, cell) for key, cell in zip(table.keys, row.cells, strict=False))
    return replace(row, cells=tuple(cells)) if table.keys else row
