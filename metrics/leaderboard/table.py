"""One table of a leaderboard: which rows are ranked, which cells are best, what stands beside."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from metrics.leaderboard.paper_tables import REPORTED, SOURCE, Figure
from metrics.scoring.metric_names import metric
from metrics.scoring.records import Score, ScoreFile
from scenegen.common.text_table import number

Kind = Literal["ranked", "not comparable", "reported"]
REPORTED_MARK, INCOMPARABLE_MARK = "†", "‡"


@dataclass(frozen=True)
class Cell:
    """A score as it is shown.

    Attributes:
        value: with 4 significant digits; as printed for the paper's figures; "-" for none.
        interval: such as "[0.1, 0.2]", or empty.
        spread: standard deviation over runs, or what the paper has after "±"; or empty.
        best: whether no ranked score of its column is better, as far as the digits tell.
    """

    value: str = "-"
    interval: str = ""
    spread: str = ""
    best: bool = False


@dataclass(frozen=True)
class Row:
    """A method.

    Attributes:
        rank: by the first column, such as "1"; empty where it has none.
        label: its name and what belongs to it, in one line; not escaped.
        kind: only "ranked" rows have ranks and best cells.
        cells: one a column.
    """

    rank: str
    label: str
    kind: Kind
    cells: tuple[Cell, ...]


@dataclass(frozen=True)
class Table:
    """Rows under column heads; `notes` stand below. Texts are not escaped."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[Row, ...]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Grid:
    """What a table of one test set is made of. Columns go by keys, files by their order.

    Attributes:
        title: above it.
        metrics: for each column's key, which score it holds.
        heads: of the columns.
        scores: of each file, by column.
        figures: of the paper, by label of their row, then by column.
        notes: below it.
        ranked: whether its first column ranks the files.
    """

    title: str
    metrics: Mapping[str, str]
    heads: tuple[str, ...]
    scores: tuple[Mapping[str, Score], ...]
    figures: Mapping[str, Mapping[str, Figure]]
    notes: tuple[str, ...]
    ranked: bool


def build_table(grid: Grid, labelled: Sequence[tuple[str, ScoreFile]]) -> Table:
    """The files' rows, best first as they come, then the paper's; labels are not escaped."""
    keys = list(grid.metrics)
    comparable = [file.comparable for _, file in labelled]
    best = {key: _best(grid, key, comparable) for key in keys}
    rows: list[Row] = []
    place, last = 0, ""
    for (label, file), scores in zip(labelled, grid.scores, strict=True):
        cells = tuple(_cell(scores.get(key), file.comparable and best[key]) for key in keys)
        rank = ""
        if grid.ranked and file.comparable and keys[0] in scores:
            place = place if cells[0].value == last else len(rows) + 1
            rank, last = str(place), cells[0].value
        rows.append(Row(rank, label, "ranked" if file.comparable else "not comparable", cells))
    for label, figures in grid.figures.items():
        cells = tuple(reported_cell(figures.get(key)) for key in keys)
        rows.append(Row("", label, "reported", cells))
    notes = [*grid.notes]
    if not all(comparable):
        notes.append(
            f"{INCOMPARABLE_MARK} not comparable, so not ranked: not all of the test set was"
            " scored, or values that are not finite were scored at the worst."
        )
    if grid.figures:
        shares = {"iqtt_accuracy"}.issuperset(grid.metrics.values())
        unit = "" if shares else "; it states no unit of length"
        notes.append(f"{REPORTED_MARK} {SOURCE}, {REPORTED}, so not ranked{unit}.")
    return Table(grid.title, grid.heads, tuple(rows), tuple(notes))


def _best(grid: Grid, key: str, comparable: Sequence[bool]) -> str:
    """The best of the comparable scores of a column, as shown; empty where there are none."""
    values = [
        s[key].value for s, may in zip(grid.scores, comparable, strict=True) if may and key in s
    ]
    if not values:
        return ""
    return number((max if metric(grid.metrics[key]).higher_is_better else min)(values))


def _cell(score: Score | None, best: str | Literal[False]) -> Cell:
    if score is None:
        return Cell()
    value, interval = number(score.value), ""
    if score.low is not None and score.high is not None:
        interval = f"[{number(score.low, score.value)}, {number(score.high, score.value)}]"
    spread = "" if score.std is None else number(score.std, score.value)
    return Cell(value, interval, spread, value == best)


def reported_cell(figure: Figure | None) -> Cell:
    """A figure of the paper as it is printed."""
    return Cell(figure.text, spread=figure.spread) if figure else Cell()


def column_head(name: str) -> str:
    """Title, direction and unit of a score."""
    known = metric(name)
    return f"{known.title} {'↑' if known.higher_is_better else '↓'} ({known.unit})"
