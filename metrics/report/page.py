"""Scores as one self-contained page: tables, distributions, and pictures of some items."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from metrics.report.charts import Svg, histogram, intervals
from metrics.report.html import render
from metrics.report.pictures import view_pictures
from metrics.report.text import (
    GROUP_SCORES,
    GROUP_TITLES,
    SKILL,
    group_tables,
    headline_rows,
    score_rows,
    source_text,
    what_the_floor_is,
)
from metrics.scoring.metric_names import HEADLINE, in_order, metric
from metrics.scoring.records import Groups, ScoreFile
from metrics.submissions.reader import RoomPredictions, open_predictions
from scenegen.common.text_table import number
from scenegen.rendering.ground_truth import decode_image
from scenegen.rooms.reader import RoomsFile

SHOWN = 3  # pictures of so many items each: the best, the median and the worst ones
COLUMNS = ("image", "true depth", "predicted depth", "error")


def html_report(scores: ScoreFile, truth_path: Path, submissions: Sequence[Path]) -> str:
    """Return the page as text; pictures come from the truth and the first run.

    Raises FileFormatError where a picture's row cannot be read.
    """
    names = in_order(scores.metrics)
    return render(
        "report.html",
        scores=scores,
        source_text=source_text(scores.meta),
        headline_rows=headline_rows(scores),
        skill_text=f"{SKILL} {what_the_floor_is(scores)}" if scores.skills else "",
        score_rows=score_rows(scores),
        groups=[
            (GROUP_TITLES[grouping].capitalize(), rows, list(_over_angle(scores, grouping)))
            for grouping, rows in group_tables(scores)
        ],
        distributions=list(_distributions(scores)),
        pictures=(
            list(_pictures(scores, truth_path, submissions[0])) if scores.task == "rooms" else ()
        ),
        definitions=[("score", "of one item"), *((n, metric(n).definition) for n in names)],
    )


def _over_angle(scores: ScoreFile, grouping: str) -> Iterator[Svg]:
    """Yield a chart of each score over the angle, if that is what the groups are of."""
    groups: Groups = getattr(scores, grouping)
    for name in GROUP_SCORES[scores.task] if grouping.endswith("_angle") else ():
        points = []
        for key, found in groups.items():
            if name in found:
                score, degrees = found[name], np.mean([float(part) for part in key.split("-")])
                low, high = (np.nan if end is None else end for end in (score.low, score.high))
                points.append((float(degrees), score.value, low, high))
        yield intervals(points, metric(name).title, metric(name).unit)


def _distributions(scores: ScoreFile) -> Iterator[Svg]:
    for name in (*HEADLINE["rooms"], "normal_mean_degrees", "derived_normal_mean_degrees"):
        if name in scores.items:
            values = np.asarray(scores.items[name], float)
            yield histogram(values, metric(name).title, metric(name).unit)


def _pictures(
    scores: ScoreFile, truth_path: Path, submission: Path
) -> Iterator[tuple[str, list[tuple[int, str, list[tuple[str, str]]]]]]:
    """Yield "Best by Relief IoU", "Median" and "Worst", each with its items.

    Of an item these are its row, scores, titles and URLs. Images without such a score are left out.
    """
    first = next(name for name in HEADLINE["rooms"] if name in scores.items)
    values = np.asarray(scores.items[first], float)
    order = np.argsort(-values if metric(first).higher_is_better else values, kind="stable")
    order = order[np.isfinite(values[order])]
    shown = min(SHOWN, len(order))
    middle = (len(order) - shown) // 2
    with RoomsFile(truth_path) as truth, open_predictions(submission) as predictions:
        assert isinstance(predictions, RoomPredictions)
        place = dict(zip(predictions.rows.tolist(), range(len(predictions)), strict=True))

        def item(entry: int) -> tuple[int, str, list[Any]]:
            row = int(scores.items["row"][entry])
            urls = view_pictures(
                decode_image(truth.read("image", row)),
                truth.read("depth", row),
                predictions.depth(place[row]),
            )
            found = [
                f"{name} {number(float(scores.items[name][entry]))}"
                for name in HEADLINE["rooms"]
                if name in scores.items
            ]
            return row, ", ".join(found), list(zip(COLUMNS, urls, strict=True))

        for title, entries in (
            ("Best", order[:shown]),
            ("Median", order[middle : middle + shown]),
            ("Worst", order[::-1][:shown]),
        ):
            yield f"{title} by {metric(first).title}", [item(entry) for entry in entries.tolist()]
