"""Score files side by side: one ranking for each test set, the paper's figures marked beside it.

Scores of different test sets never meet in one ranking, scores that are not comparable stand below
it, and the paper's own figures, measured on the authors' data, stand apart from both.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from metrics.leaderboard.paper_tables import REPORTED, TABLES, Figure, PaperTable
from metrics.leaderboard.table import (
    INCOMPARABLE_MARK,
    REPORTED_MARK,
    Grid,
    Row,
    Table,
    build_table,
    column_head,
    reported_cell,
)
from metrics.measures.answers import CHANCE
from metrics.scoring.metric_names import HEADLINE, metric
from metrics.scoring.records import ID_COLUMNS, ScoreFile
from scenegen.common.errors import SceneGenError
from scenegen.common.text_table import distinct, number, plain


class LeaderboardError(SceneGenError):
    """Score files that cannot stand in one table."""


@dataclass(frozen=True)
class Leaderboard:
    """Tables in order; `leaderboard_text` renders them."""

    tables: tuple[Table, ...]


def leaderboard(
    files: Sequence[ScoreFile],
    metrics: Sequence[str] | None = None,
    *,
    paper: bool = True,
) -> Leaderboard:
    """Tables of these scores, grouped by test set in the order of the files.

    Args:
        files: any number, of any test sets.
        metrics: names of columns, the first to rank by; those of a task that has none of them, and
            of both by default, are `metric_names.HEADLINE`.
        paper: whether to show the paper's figures: in each ranking those that share its columns,
            and at the end its tables that found no place.

    Raises LeaderboardError where files that say they score all of one test set score different
    rows of it, and UnknownMetricError.
    """
    for name in metrics or ():
        metric(name)
    groups: dict[tuple[str, str], list[ScoreFile]] = {}
    for file in files:
        groups.setdefault((file.task, file.meta.truth_fingerprint), []).append(file)
    tables: list[Table] = []
    shown: set[Figure] = set()
    for (task, _), members in groups.items():
        _require_same_rows(members)
        own = [name for name in dict.fromkeys(metrics or ()) if metric(name).task == task]
        names = own or HEADLINE[task]
        figures = [f for t in TABLES for f in t.figures if paper and f.metric in names]
        order = _ranking(members, names[0])
        labels = distinct([f.method for f in members], [_stem(f) for f in members])
        labelled = [(_label(members[i], labels[i]), members[i]) for i in order]
        for grid in _grids(labelled, names, figures):
            tables.append(build_table(grid, labelled))
            shown.update(figure for row in grid.figures.values() for figure in row.values())
    if paper:
        tables += [_paper_table(t) for t in TABLES if not shown.issuperset(t.figures)]
    return Leaderboard(tuple(tables))


def _require_same_rows(files: Sequence[ScoreFile]) -> None:
    whole = [file for file in files if file.comparable]
    for file in whole[1:]:
        if not np.array_equal(np.sort(file.ids), np.sort(whole[0].ids)):
            what = ID_COLUMNS[file.task][0]
            raise LeaderboardError(
                f"{file.place}: found {len(file.ids)} {what}s, expected the {len(whole[0].ids)} of"
                f" {whole[0].place}, as both say that they score the whole of one test set"
            )


def _ranking(files: Sequence[ScoreFile], name: str) -> list[int]:
    """Positions of the files: comparable ones from best to worst, those without a score, others."""

    def place(i: int) -> tuple[bool, bool, float]:
        score = files[i].metrics.get(name)
        sign = -1.0 if metric(name).higher_is_better else 1.0
        return not files[i].comparable, score is None, sign * score.value if score else 0.0

    return sorted(range(len(files)), key=place)


def _stem(file: ScoreFile) -> str:
    return file.path.stem if file.path else ""


def _label(file: ScoreFile, name: str) -> str:
    told = [f"{file.runs} runs"] if file.runs > 1 else []
    if file.alignment != "none":
        claim = metric(f"rmse_after_{file.alignment}").title.partition(", ")[2]
        told.append(f"claims depth when {claim}")
    mark = "" if file.comparable else f" {INCOMPARABLE_MARK}"
    return name + (f" ({'; '.join(told)})" if told else "") + mark


def _grids(
    labelled: Sequence[tuple[str, ScoreFile]], names: Sequence[str], figures: Sequence[Figure]
) -> Iterator[Grid]:
    """The ranking of a test set, then each score by view angle where any file has such."""
    files = [file for _, file in labelled]
    first = files[0]
    what = "Rooms" if first.task == "rooms" else "3D-IQTT"
    title = f"{what}, truth {plain(first.meta.truth_fingerprint)[:12]}"
    yield Grid(
        title,
        {name: name for name in names},
        tuple(column_head(name) for name in names),
        tuple(file.metrics for file in files),
        _by_row((f, f.metric) for f in figures if f.view_angle is None),
        tuple(_notes(files, names)),
        ranked=True,
    )
    for name in names:
        found = [
            {angle: scores[name] for angle, scores in file.by_view_angle.items() if name in scores}
            for file in files
        ]
        angles = sorted({angle for scores in found for angle in scores}, key=int)
        if angles:
            turned = [(f, str(f.view_angle)) for f in figures if f.metric == name]
            yield Grid(
                f"{title}: {column_head(name)} by view angle",
                dict.fromkeys(angles, name),
                tuple(f"{angle}°" for angle in angles),
                tuple(found),
                _by_row((f, angle) for f, angle in turned if angle in angles),
                ("Angle between each view and its scene's first one. Rows as in the ranking.",),
                ranked=False,
            )


def _by_row(figures: Iterable[tuple[Figure, str]]) -> dict[str, dict[str, Figure]]:
    """Figures of the paper by the label of their row, then by column."""
    rows: dict[str, dict[str, Figure]] = {}
    for figure, key in figures:
        labels = "" if figure.labels is None else f", {figure.labels} labels"
        label = f"{figure.method}, {figure.data}{labels} (Table {figure.table}) {REPORTED_MARK}"
        rows.setdefault(label, {})[key] = figure
    return rows


def _notes(files: Sequence[ScoreFile], names: Sequence[str]) -> Iterator[str]:
    first = files[0]
    clusters = len(np.unique(first.clusters))
    if first.task == "rooms":
        yield f"{len(first.ids):,} images of {clusters:,} scenes."
    else:
        yield f"{clusters:,} questions; chance is {CHANCE:.4f}."
    levels = " and ".join(
        f"{level:.4g}%" for level in sorted({100.0 * f.meta.confidence for f in files})
    )
    yield (
        f"[low, high]: {levels} interval over {'scenes' if first.task == 'rooms' else 'questions'}."
        " ±: standard deviation over training runs. Best in bold, which is no test of a difference:"
        " see bench compare."
    )
    floors = [f.meta.chamfer_floor for f in files if f.meta.chamfer_floor is not None]
    if floors and "chamfer" in names:
        yield f"Noise floor of Chamfer at this resolution: {number(max(floors))} scene units."


def _paper_table(table: PaperTable) -> Table:
    """A table of the paper on its own."""
    keys: dict[str, None] = {}
    rows: dict[str, dict[str, Figure]] = {}
    for figure in table.figures:
        key = metric(figure.metric).title
        key += "" if figure.view_angle is None else f" {figure.view_angle}°"
        key += "" if figure.labels is None else f", {figure.labels} labels"
        keys[key] = None
        label = f"{figure.method}, {figure.data} {REPORTED_MARK}"
        rows.setdefault(label, {})[key] = figure
    return Table(
        f"{table.source}. {table.caption}",
        tuple(keys),
        tuple(
            Row("", label, "reported", tuple(reported_cell(figures.get(key)) for key in keys))
            for label, figures in rows.items()
        ),
        (f"{REPORTED_MARK} {REPORTED}. Unit: {table.unit}.", table.remark),
    )
