"""Curves of a report: scores over the angle between a view and its scene's first one."""

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from metrics.measures.statistics import cluster_means
from metrics.report.charts import COLOURS, FLOOR, Chart, Point, Series, curves, kind_of
from metrics.report.headline import PAPER
from metrics.report.paper_tables import TABLES
from metrics.report.text import FLOORS_OF_ROOMS
from metrics.scoring.metric_names import HEADLINE, SKILLED, metric
from metrics.scoring.records import Score, ScoreFile


def angle_floors(file: ScoreFile, name: str) -> dict[str, float]:
    """Return the mean of a score's floor by view angle, in whole degrees, from the items."""
    angles, column = map(file.items.get, ("view_angle_degrees", SKILLED.get(name, "") + name))
    if angles is None or column is None or name not in SKILLED:
        return {}
    found = {}
    for degrees in file.by_view_angle:
        chosen = (angles == int(degrees)) & np.isfinite(column)
        if chosen.any():
            found[degrees] = float(cluster_means(column[chosen], file.clusters[chosen]).mean())
    return found


def view_curves(files: Sequence[ScoreFile], labels: Sequence[str]) -> Iterator[Chart]:
    """Yield a chart of each main score by view angle: of the methods, and of the first one's floor.

    The table of each also has what the paper reports; it is not drawn, as its unit is not known.
    There is no chart where all views have one angle. Of many methods the first six are drawn, as
    more could not be told apart.
    """
    files, labels = files[:COLOURS], labels[:COLOURS]
    for name in HEADLINE["rooms"]:
        series = [
            Series(label, _points(file.by_view_angle, name), kind_of(i))
            for i, (file, label) in enumerate(zip(files, labels, strict=True))
        ]
        floors = angle_floors(files[0], name)
        if floors:
            points = [Point(float(key), floors[key]) for key in sorted(floors, key=int)]
            series.append(Series(f"floor: {FLOORS_OF_ROOMS[SKILLED[name]]}", points, FLOOR))
        if len({point.at for one in series for point in one.points}) < 2:
            continue
        known = metric(name)
        chart = curves(series, known.title, known.unit, (known.smallest, known.largest))
        if chart:
            yield _with_paper(chart, name)


def _points(groups: Mapping[str, Mapping[str, Score]], name: str) -> list[Point]:
    found = sorted((int(key), scores[name]) for key, scores in groups.items() if name in scores)
    return [
        Point(
            degrees, score.value, *(math.nan if e is None else e for e in (score.low, score.high))
        )
        for degrees, score in found
    ]


def _with_paper(chart: Chart, name: str) -> Chart:
    """Add the paper's figures of a score by view angle to the table of a chart, a column each."""
    told: dict[str, dict[str, str]] = {}
    for table in TABLES[:3]:
        for f in table.figures:
            if f.metric == name and f.method == PAPER and f.view_angle is not None:
                told.setdefault(f"{PAPER} †, {f.data}", {})[str(f.view_angle)] = f.text
    rows = [(*row, *(texts.get(row[0], "-") for texts in told.values())) for row in chart.rows]
    return Chart(chart.title, chart.svg, chart.legend, (*chart.head, *told), rows)
