"""Scores over the angle between a view and its scene's first one: floors and curves."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from metrics.measures.statistics import cluster_means
from metrics.scoring.metric_names import BASELINES, HEADLINE, metric
from metrics.scoring.records import Score, ScoreFile
from metrics.views.paper import PAPER, PaperTable, tables_beside
from metrics.views.plots import COLOURS, LINE, Chart, Point, Series, curves, kind_of
from metrics.views.table import Cell, make_table


def angle_floors(file: ScoreFile, name: str) -> dict[str, float]:
    """Return the mean of a score's floor by view angle, in whole degrees, from the items."""
    angles, column = (
        file.items.get("view_angle_degrees"),
        file.items.get(f"{file.floor_of(name)}{name}"),
    )
    if angles is None or column is None:
        return {}
    floors = {}
    for degrees in file.by_view_angle:
        chosen = (np.abs(angles) == int(degrees)) & np.isfinite(column)
        if chosen.any():
            floors[degrees] = float(cluster_means(column[chosen], file.clusters[chosen]).mean())
    return floors


def view_curves(files: Sequence[ScoreFile], labels: Sequence[str]) -> Iterator[Chart]:
    """Yield a chart of each main score by view angle: of the methods, and of the first one's floor.

    The table of each also has the paper's figures. They are not drawn, as the paper states no unit.
    There is no chart where all views have one angle. Of many methods the first six are drawn, as
    more could not be told apart.
    """
    files, labels = files[:COLOURS], labels[:COLOURS]
    for name in HEADLINE["rooms"]:
        series = [
            Series(label, _points(file, name), kind_of(i))
            for i, (file, label) in enumerate(zip(files, labels, strict=True))
        ]
        floors = angle_floors(files[0], name)
        points = [Point(float(key), floors[key]) for key in sorted(floors, key=int)]
        if points:
            series.append(
                Series(f"floor: {BASELINES[str(files[0].floor_of(name))].name}", points, LINE)
            )
        if len({point.at for line in series for point in line.points}) >= 2:
            chart = curves(series, metric(name).title, files[0].unit_of(name))
            assert chart is not None
            yield _with_paper(chart, name, tables_beside(files[0]))


def _points(file: ScoreFile, name: str) -> list[Point]:
    groups = file.by_view_angle
    keys = sorted((key for key in groups if name in groups[key]), key=int)
    return [score_point(groups[key][name], float(key)) for key in keys]


def score_point(score: Score, at: float = 0.0) -> Point:
    """Return a score and its interval as a point of a chart."""
    return Point(at, score.value, score.low, score.high)


def _with_paper(chart: Chart, name: str, tables: Sequence[PaperTable]) -> Chart:
    """Add a column for each data set on which the paper reports its method by view angle."""
    columns: dict[str, dict[str, str]] = {}
    for table in tables[:3]:
        for f in table.figures:
            if f.metric == name and f.method == PAPER and f.view_angle is not None:
                columns.setdefault(f"{PAPER} †, {f.data}", {})[str(f.view_angle)] = f.text
    numbers = chart.table
    assert numbers is not None
    rows: list[Sequence[Cell | str]] = [
        (*row.cells, *(texts.get(row.cells[0].value, "-") for texts in columns.values()))
        for row in numbers.rows
    ]
    return replace(chart, table=make_table(numbers.title, (*numbers.head, *columns), rows))
