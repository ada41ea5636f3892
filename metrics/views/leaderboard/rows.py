"""Rows of a leaderboard: methods with their ranks, then floors, then the paper's figures."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from metrics.scoring.metric_names import metric
from metrics.scoring.records import Score, ScoreFile, Skill
from metrics.views.paper import REPORTED, SOURCE, Figure
from metrics.views.score_tables import score_cell
from metrics.views.table import Cell, Row, Table, make_row

REPORTED_MARK, INCOMPARABLE_MARK = "†", "‡"
NOT_COMPARABLE = (
    f"{INCOMPARABLE_MARK} not comparable, so not ranked: not all of the test set was scored, or"
    " values that are not finite were given the worst score, or only the submission named the truth"
    " (score it again with --truth)."
)
BELOW = (
    "Methods below the line of the floor are not better than it, by their interval, so they have no"
    " rank; the next column orders them."
)
Cells = Mapping[str, Mapping[str, Cell]]  # by the label of the row, then by the key of the column


@dataclass(frozen=True)
class Column:
    """The head of a column, and which of its scores are better."""

    head: str
    higher_is_better: bool = True


@dataclass(frozen=True)
class Entry:
    """A method in a table.

    Attributes:
        label: the method's name and what has to be known about it.
        scores: by the keys of the columns.
        floors: those that other methods do not share, by the keys of the columns.
        rank: its place, which methods that are not told apart share; empty for those without one.
        card: cells of its card, by their heads; empty where no method has one.
    """

    label: str
    file: ScoreFile
    scores: Mapping[str, Score | Skill]
    floors: Mapping[str, float]
    rank: str = ""
    card: Mapping[str, Cell] = field(default_factory=dict)


def build_table(
    title: str,
    columns: Mapping[str, Column],
    entries: Sequence[Entry],
    floors: Cells,
    figures: Cells,
    notes: Sequence[str],
    differ: Callable[[Entry, Entry, str], bool],
    line: str,
    ranked: bool,
) -> Table:
    """Return a table of the scored methods, then of floors, then of the paper's figures.

    Args:
        columns: the columns by their keys.
        entries: the methods, best first.
        notes: stand below the table, before those on marks of its rows.
        differ: tells whether two methods differ in a column by more than chance.
        line: label of the floor that stands right below the methods with a rank.
        ranked: whether the first column shows the ranks.
    """
    best = {k: _best(entries, k, column, differ) for k, column in columns.items()}
    about = tuple(dict.fromkeys(head for e in entries for head in e.card)) if ranked else ()
    rows = [
        make_row(
            [
                entry.rank if ranked else "",
                entry.label,
                *(
                    score_cell(entry.scores.get(key), entry is best[key], entry.floors.get(key))
                    for key in columns
                ),
                *(entry.card.get(head, Cell()) for head in about),
            ],
            "" if entry.file.comparable else "incomparable",
        )
        for entry in entries
    ]
    above = sum(bool(entry.rank) for entry in entries)
    keys, notes = (*columns, *about), list(notes)
    rows[above:above] = _unranked("floor", {k: v for k, v in floors.items() if k == line}, keys)
    rows += _unranked("floor", {k: v for k, v in floors.items() if k != line}, keys)
    rows += _unranked("reported", figures, keys)
    if ranked and line in floors and any(e.file.comparable for e in entries[above:]):
        notes.append(BELOW)
    if not all(entry.file.comparable for entry in entries):
        notes.append(NOT_COMPARABLE)
    if figures:
        unit = "; it states no unit of length" if entries[0].file.task == "rooms" else ""
        notes.append(f"{REPORTED_MARK} {SOURCE}, {REPORTED}, so not ranked{unit}.")
    head = ("#", "method", *(column.head for column in columns.values()), *about)
    return Table(title, head, tuple(rows), tuple(notes), named_by=1)


def _unranked(kind: str, cells: Cells, keys: Sequence[str]) -> list[Row]:
    """Return a row without a rank for each label."""
    return [
        make_row(["", label, *(row.get(key, Cell()) for key in keys)], kind)
        for label, row in cells.items()
    ]


def _best(
    entries: Sequence[Entry],
    key: str,
    column: Column,
    differ: Callable[[Entry, Entry, str], bool],
) -> Entry | None:
    """Return the method that is better in a column than all others; None without one.

    There must be another one, and the next best must differ from it. A skill of 0 or less is the
    best of nothing.
    """
    sign = -1.0 if column.higher_is_better else 1.0
    there = [e for e in entries if e.file.comparable and key in e.scores]
    there.sort(key=lambda e: sign * e.scores[key].value)
    if len(there) < 2:
        return None
    first, second, *_ = there
    score = first.scores[key]
    is_better = isinstance(score, Score) or score.value > 0.0
    return first if is_better and differ(first, second, key) else None


def score_column(name: str, unit: str) -> Column:
    """Return the column of a score: title, an arrow that tells which way is better, and unit."""
    score = metric(name)
    arrow = "↑" if score.higher_is_better else "↓"
    return Column(f"{score.title} {arrow} ({unit})", score.higher_is_better)


def skill_column(name: str) -> Column:
    """Return the column of the skill of a score."""
    return Column(f"{metric(name).title}: skill ↑")


def figure_cells(figures: Iterable[Figure]) -> Cells:
    """Return figures of the paper as printed, by method, data and table, then by score."""
    rows: dict[str, dict[str, Cell]] = {}
    for f in figures:
        labels = "" if f.labels is None else f", {f.labels} labels"
        label = f"{f.method}, {f.data}{labels} (Table {f.table}) {REPORTED_MARK}"
        rows.setdefault(label, {})[f.metric] = Cell(f.text, f"± {f.spread}" if f.spread else "")
    return rows
