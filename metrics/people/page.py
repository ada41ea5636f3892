"""The report on people's answers as one page that loads nothing: charts, and a table of each."""

import math
from collections.abc import Iterator, Sequence

from metrics.people.charts import Svg, bars, intervals
from metrics.people.figures import Figures, Group
from metrics.people.intervals import Estimate
from metrics.people.text import group_tables, head, histogram_table, notes, summary_tables
from metrics.report.html import render

Section = tuple[str, Sequence[Svg], Sequence[Sequence[str]]]  # title, charts, rows of the table


def html_report(figures: Figures) -> str:
    """Return the page as text."""
    return render(
        "people.html",
        head=head(figures),
        sections=list(_sections(figures)),
        notes=notes(figures),
    )


def _sections(figures: Figures) -> Iterator[Section]:
    for title, rows in summary_tables(figures):
        yield title, (), rows
    title, rows = histogram_table(figures)
    counts = {row[0]: int(row[1]) for row in rows[1:]}
    yield title, (bars(counts, title, "right answers"),), [row[:2] for row in rows]
    charts = {"By kind of question": _by_kind, "By angle between the views": _by_angle}
    for title, rows in group_tables(figures):
        yield title, tuple(charts[title](figures)), rows


def _by_kind(figures: Figures) -> Iterator[Svg]:
    shares = {one.name: 100 * one.accuracy.value for one in figures.by_kind}
    yield bars(shares, "Right answers by kind (percent)", "kind")


def _by_angle(figures: Figures) -> Iterator[Svg]:
    groups = figures.by_angle
    yield intervals(
        [(_middle(one), *_ends(one.accuracy, 100)) for one in groups],
        "Right answers by angle", "percent",
    )  # fmt: skip
    line = None if figures.line is None else (figures.line.intercept, figures.line.slope.value)
    yield intervals(
        [(_middle(one), *_ends(one.seconds, 1)) for one in groups if one.seconds is not None],
        "Time of right answers by angle", "seconds", line,
    )  # fmt: skip


def _middle(group: Group) -> float:
    low, high = map(float, group.name.split("-"))
    return (low + high) / 2


def _ends(one: Estimate, scale: float) -> tuple[float, float, float]:
    low, high = (math.nan if end is None else scale * end for end in (one.low, one.high))
    return scale * one.value, low, high
