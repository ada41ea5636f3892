"""Rows of a leaderboard: methods with their ranks, then floors, then the paper's figures."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from metrics.scoring.metric_names import metric
from metrics.scoring.records import Score, ScoreFile, Skill
from metrics.views.paper import REPORTED, SOURCE, Figure, PaperTable
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
        link: address of its own page; or empty.
        card: cells of its card, by their heads; empty where no method has one.
    """

    label: str
    file: ScoreFile
    scores: Mapping[str, Score | Skill]
    floors: Mapping[str, float]
    rank: str = ""
    link: str = ""
    card: Mapping[str, Cell] = field(default_factory=dict)


def build_table(
    title: str,
    columns: Mapping[str, Column],
    entries: Sequence[Entry],
    floors: Cells,
    figures: Cells,
    notes: Sequence[str],
    line: str = "",
    ranked: bool = False,
    differ: Callable[[Entry, Entry, str], bool] | None = None,
) -> Table:
    """Return a table of the scored methods, then of floors, then of the paper's figures.

    Args:
        columns: the columns by their keys.
        entries: the methods, best first.
        differ: tells whether two methods differ in a column by more than chance; by default, where
            their intervals do not meet.
        notes: stand below the table, before those on marks of its rows.
        line: label of the floor that stands right below the methods with a rank.
        ranked: whether the first column shows the ranks.
    """
    best = {k: _best(entries, k, column, differ or _apart) for k, column in columns.items()}
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
            entry.link,
        )
        for entry in entries
    ]
    above = sum(bool(entry.rank) for entry in entries)
    keys, notes = (*columns, *about), list(notes)
    rows[above:above] = unranked_rows("floor", {k: v for k, v in floors.items() if k == line}, keys)
    rows += unranked_rows("floor", {k: v for k, v in floors.items() if k != line}, keys)
    rows += unranked_rows("reported", figures, keys)
    if ranked and line in floors and any(e.file.comparable for e in entries[above:]):
        notes.append(BELOW)
    if not all(entry.file.comparable for entry in entries):
        notes.append(NOT_COMPARABLE)
    if figures:
        unit = "; it states no unit of length" if entries[0].file.task == "rooms" else ""
        notes.append(f"{REPORTED_MARK} {SOURCE}, {REPORTED}, so not ranked{unit}.")
    head = ("#", "method", *(column.head for column in columns.values()), *about)
    return Table(title, head, tuple(rows), tuple(notes), named_by=1)


def unranked_rows(kind: str, cells: Cells, keys: Sequence[str]) -> list[Row]:
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


def _apart(first: Entry, second: Entry, key: str) -> bool:
    """Return whether the intervals of two methods' scores do not meet."""
    a, b = first.scores[key], second.scores[key]
    if a.low is None or a.high is None or b.low is None or b.high is None:
        return False
    return a.low > b.high or b.low > a.high


def score_column(name: str) -> Column:
    """Return the column of a score: title, an arrow that tells which way is better, and unit."""
    score = metric(name)
    arrow = "↑" if score.higher_is_better else "↓"
    return Column(f"{score.title} {arrow} ({score.unit})", score.higher_is_better)


def skill_column(name: str) -> Column:
    """Return the column of the skill of a score."""
    return Column(f"{metric(name).title}: skill ↑")


def figure_cells(
    figures: Iterable[Figure], key: Callable[[Figure], str], place: bool = True
) -> dict[str, dict[str, Cell]]:
    """Return figures of the paper as printed; `place` adds table and labels to the row's name."""
    rows: dict[str, dict[str, Cell]] = {}
    for f in figures:
        labels = "" if f.labels is None or not place else f", {f.labels} labels"
        table = f" (Table {f.table})" if place else ""
        label = f"{f.method}, {f.data}{labels}{table} {REPORTED_MARK}"
        rows.setdefault(label, {})[key(f)] = Cell(f.text, f"± {f.spread}" if f.spread else "")
    return rows


def paper_table(table: PaperTable) -> Table:
    """Return a table of the paper on its own."""

    def key(figure: Figure) -> str:
        angle = "" if figure.view_angle is None else f" {figure.view_angle}°"
        labels = "" if figure.labels is None else f", {figure.labels} labels"
        return metric(figure.metric).title + angle + labels

    keys = tuple(dict.fromkeys(map(key, table.figures)))
    rows = unranked_rows("reported", figure_cells(table.figures, key, place=False), keys)
    title = f"{SOURCE}, {table.kind} {table.number}: {REPORTED}. {table.caption}"
    notes = (f"{REPORTED_MARK} {REPORTED}. Unit: {table.unit}.", table.remark)
    return Table(title, ("#", "method", *keys), tuple(rows), notes, named_by=1)
