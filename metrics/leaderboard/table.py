"""One table of a leaderboard: its rows, their ranks, and the best cell of each column."""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from metrics.report.paper_tables import REPORTED, SOURCE, Figure
from metrics.report.text import as_shown, interval_cells
from metrics.scoring.metric_names import metric
from metrics.scoring.records import Score, ScoreFile, Skill
from scenegen.common.text_table import number

Kind = Literal["ranked", "incomparable", "floor", "reported"]
Scores = Mapping[str, Score | Skill]
Entry = tuple[str, ScoreFile, Scores, Mapping[str, float]]
REPORTED_MARK, INCOMPARABLE_MARK = "†", "‡"


@dataclass(frozen=True)
class Column:
    """The head of a column, and which of its scores are better."""

    head: str
    higher_is_better: bool


@dataclass(frozen=True)
class Cell:
    """A score as it is shown.

    Attributes:
        value: the score with 4 significant digits, or a figure of the paper as printed; "-" where
            there is none.
        rest: what follows the value, such as " ± 0.01 [0.1, 0.2]": standard deviation over runs
            (or what the paper prints after "±"), the interval, and a floor that other methods do
            not share; or empty.
        best: whether no ranked score of the column is better, as far as the shown digits tell.
    """

    value: str = "-"
    rest: str = ""
    best: bool = False


@dataclass(frozen=True)
class Row:
    """A method and its cells, one for each column.

    Attributes:
        rank: its place by the first column, such as "1"; empty where it has none.
        label: the method's name and what has to be known about it, in one line, not escaped.
        kind: only "ranked" rows have ranks and best cells; "floor" rows say what a method without
            sight, chance or noise gives.
        file: whose scores they are; None for floors and the paper's figures.
        link: address of the method's own page; or empty.
    """

    rank: str
    label: str
    kind: Kind
    cells: tuple[Cell, ...]
    file: ScoreFile | None = None
    link: str = ""


@dataclass(frozen=True)
class Table:
    """Rows under the heads of their columns, with notes below. The texts are not escaped.

    `keys` has the key of each column: the name of a score, of a skill, or of a group.
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[Row, ...]
    notes: tuple[str, ...] = ()
    keys: tuple[str, ...] = ()

    @property
    def parts(self) -> list[tuple[Row, ...]]:
        """The rows in order, cut where another kind of row begins."""
        return [tuple(part) for _, part in itertools.groupby(self.rows, lambda row: row.kind)]


def build_table(
    title: str,
    columns: Mapping[str, Column],
    entries: Sequence[Entry],
    floors: Mapping[str, Mapping[str, float]],
    figures: Mapping[str, Mapping[str, Figure]],
    notes: Sequence[str],
    ranked: bool,
) -> Table:
    """Return a table of the scored methods, then of floors, then of the paper's figures.

    Args:
        columns: the columns by their keys.
        entries: for each method, best first: its label, its score file, its scores by the
            columns' keys, and so those of their floors that other methods do not share.
        floors: values by the label of their row, then by the columns' keys.
        figures: of the paper, by the label of their row, then by the columns' keys.
        notes: stand below the table, before those on marks that its rows bear.
        ranked: whether the first column ranks the methods.
    """
    first = next(iter(columns))
    best = {key: _best(entries, key, column) for key, column in columns.items()}
    rows: list[Row] = []
    place, last = 0, ""
    for label, file, scores, own in entries:
        comparable = file.comparable
        cells = tuple(
            _cell(scores.get(key), comparable and best[key], own.get(key)) for key in columns
        )
        rank = ""
        if ranked and comparable and first in scores:
            place = place if cells[0].value == last else len(rows) + 1
            rank, last = str(place), cells[0].value
        kind: Kind = "ranked" if comparable else "incomparable"
        rows.append(Row(rank, label, kind, cells, file))
    for label, values in floors.items():
        texts = (number(values[key]) if key in values else "-" for key in columns)
        rows.append(Row("", label, "floor", tuple(map(Cell, texts))))
    told = list(notes)
    if not all(file.comparable for _, file, *_ in entries):
        told.append(
            f"{INCOMPARABLE_MARK} not comparable, so not ranked: not all of the test set was"
            " scored, or values that are not finite were given the worst score, or only the"
            " submission named the truth (score it again with --truth)."
        )
    if figures:
        shares = all(
            figure.labels is not None for row in figures.values() for figure in row.values()
        )
        unit = "" if shares else "; it states no unit of length"
        told.append(f"{REPORTED_MARK} {SOURCE}, {REPORTED}, so not ranked{unit}.")
    rows += reported_rows(figures, tuple(columns))
    heads = tuple(c.head for c in columns.values())
    return Table(title, heads, tuple(rows), tuple(told), tuple(columns))


def reported_rows(
    figures: Mapping[str, Mapping[str, Figure]], keys: Sequence[str]
) -> tuple[Row, ...]:
    """Return a row of the paper's figures, as printed, for each label."""
    rows = []
    for label, found in figures.items():
        cells = {k: Cell(f.text, f" ± {f.spread}" if f.spread else "") for k, f in found.items()}
        rows.append(Row("", label, "reported", tuple(cells.get(key, Cell()) for key in keys)))
    return tuple(rows)


def score_column(name: str) -> Column:
    """Return the column of a score: title, an arrow that tells which way is better, and unit."""
    known = metric(name)
    arrow = "↑" if known.higher_is_better else "↓"
    return Column(f"{known.title} {arrow} ({known.unit})", known.higher_is_better)


def skill_column(name: str) -> Column:
    """Return the column of the skill of a score."""
    return Column(f"{metric(name).title}: skill ↑", True)


def _best(entries: Sequence[Entry], key: str, column: Column) -> str:
    """The best of the comparable scores of a column as it is shown; empty where there is none."""
    found = [scores[key] for _, file, scores, _ in entries if file.comparable and key in scores]
    better = max if column.higher_is_better else min
    return interval_cells(better(found, key=lambda one: one.value))[0] if found else ""


def _cell(score: Score | Skill | None, best: str | Literal[False], floor: float | None) -> Cell:
    if score is None:
        return Cell()
    value, interval = interval_cells(score)
    std = getattr(score, "std", None)
    spread = "" if std is None else f" ± {number(std, score.value)}"
    ends = "" if interval == "-" else f" {interval}"
    own = "" if floor is None else f" floor {number(floor, as_shown(score))}"
    return Cell(value, spread + ends + own, value == best)
