"""The figures of people's answers as text, as JSON, and as a page with charts."""

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict

from metrics.views.page import Section, html_page
from metrics.views.people.figures import Figures, Group
from metrics.views.people.intervals import CONFIDENCE, Estimate, Line
from metrics.views.people.references import CONFLICT, SHAPIRO
from metrics.views.plots import LINE, Chart, Point, Series, bars, curves
from metrics.views.table import Table, make_table, to_text

FORMAT_NAME, FORMAT_VERSION = "pix2shape-bench/quiz-report", "1.0"
NONE = "-"
BAR = 40  # characters of the longest bar


def text_report(figures: Figures) -> str:
    """Return all tables, each with its title, and the notes."""
    tables = [*_summary(figures), _histogram(figures), _by_kind(figures), _by_angle(figures)]
    notes = [f"note: {note}" for note in _notes(figures)]
    return to_text(_title(figures), [table for table in tables if table.rows], notes)


def to_json(figures: Figures) -> str:
    """Return JSON whose keys are the attributes of `Figures` and of what is in it."""
    content = {
        "format": FORMAT_NAME,
        "format_version": FORMAT_VERSION,
        "confidence": CONFIDENCE,
        **asdict(figures),
        "notes": _notes(figures),
    }
    return json.dumps(content, indent=2, allow_nan=False) + "\n"


def html_report(figures: Figures) -> str:
    """Return a page with a section for each table, and charts of right answers and times."""
    histogram, by_kind, by_angle = _histogram(figures), _by_kind(figures), _by_angle(figures)
    counts = bars(figures.histogram, histogram.title, "right answers", "participants")
    sections = [
        *(Section(table.title, tables=[table]) for table in _summary(figures)),
        Section(histogram.title, tables=[histogram], charts=[counts]),
        Section(by_kind.title, tables=[by_kind]),
    ]
    if by_angle.rows:
        charts = list(_charts(figures))
        sections.append(Section(by_angle.title, tables=[by_angle], charts=charts))
    sections.append(Section("Notes", notes=_notes(figures)))
    return html_page("What people answered", sections, warnings=[])


def _title(figures: Figures) -> str:
    people = f"{figures.finished} participants finished of {figures.begun} who began"
    questions = f"{figures.questions} questions each, {figures.distinct} different ones"
    return f"{people}; {questions}, with {figures.candidates} answers"


def _summary(figures: Figures) -> Iterator[Table]:
    """Yield accuracy, what stands beside it, the tests, and the line of response times."""
    rows = [
        (f"mean, sample {sample}", _percent(mean.value), _ends(mean))
        for sample, mean in (
            ("of participants", figures.accuracy),
            ("of participants and questions", figures.crossed),
        )
    ]
    if figures.deviation is not None:
        rows.append(("standard deviation of participants", _percent(figures.deviation), ""))
    yield make_table("Accuracy", ("accuracy in percent", "value", "95% interval"), rows)
    head = ("accuracy in percent", "value", "where it comes from")
    rows = [(other.name, _percent(other.value), other.note) for other in figures.references]
    yield make_table("Beside it", head, rows)
    yield make_table(
        "Tests", ("test", "of", "difference in points", "statistic", "p"), _tests(figures)
    )
    if figures.line is not None:
        title = "Time of right answers over the angle between views"
        yield make_table(title, ("", "value", "95% interval"), _line_rows(figures.line))


def _tests(figures: Figures) -> Iterator[tuple[str, ...]]:
    for test in figures.tests:
        statistic = NONE if test.t is None else f"t({test.degrees}) = {test.t:.2f}"
        difference = f"{100 * test.difference.value:+.1f} {_ends(test.difference)}"
        against = f"people against {test.against}, {_percent(test.other)}"
        yield "Student, one sample", against, difference, statistic, _p_value(test.p)
    statistic, p = (NONE, NONE)
    if figures.shapiro is not None:
        statistic, p = f"W = {figures.shapiro[0]:.4f}", _p_value(figures.shapiro[1])
    yield "Shapiro-Wilk", "scores are normally distributed", "", statistic, p


def _line_rows(line: Line) -> Iterator[tuple[str, ...]]:
    slope = line.slope
    yield "slope, milliseconds per degree", f"{1000 * slope.value:.1f}", _ends(slope, 1000)
    yield "intercept, seconds", f"{line.intercept:.2f}", ""
    if slope.value > 0:
        yield "speed, degrees per second", f"{1 / slope.value:.0f}", ""
    yield "right answers with a time", str(line.answers), ""


def _histogram(figures: Figures) -> Table:
    """Return how many participants had how many right answers, with bars."""
    counts = figures.histogram
    most = max(BAR, *counts)
    first, last = min(figures.scores), max(figures.scores)
    rows = [
        (str(right), str(counts[right]), "#" * math.ceil(BAR * counts[right] / most))
        for right in range(first, last + 1)
    ]
    title = "Participants by their number of right answers"
    return make_table(title, ("right answers", "participants", ""), rows)


def _by_kind(figures: Figures) -> Table:
    rows = []
    for group in figures.by_kind:
        floor = NONE if group.floor is None else _percent(group.floor)
        slope = NONE
        if group.line is not None:
            slope = f"{1000 * group.line.slope.value:.1f} {_ends(group.line.slope, 1000)}"
        rows.append((*_group_cells(group), floor, slope))
    head = (*_group_head("kind"), "floor", "slope, ms per degree")
    return make_table("By kind of question", head, rows)


def _by_angle(figures: Figures) -> Table:
    rows = map(_group_cells, figures.by_angle)
    return make_table("By angle between the views", _group_head("degrees"), rows)


def _group_head(first: str) -> tuple[str, ...]:
    return first, "answers", "right in percent", "95% interval", "seconds if right", "95% interval"


def _group_cells(group: Group) -> tuple[str, ...]:
    seconds = (NONE, NONE)
    if group.seconds is not None:
        seconds = f"{group.seconds.value:.2f}", _ends(group.seconds, 1, 2)
    accuracy = _percent(group.accuracy.value), _ends(group.accuracy)
    return group.name, str(group.answers), *accuracy, *seconds


def _charts(figures: Figures) -> Iterator[Chart]:
    """Yield right answers and times over the angle, with the line that fits the times."""
    groups, line = figures.by_angle, figures.line
    right = [_point(group, group.accuracy, 100) for group in groups]
    chance = [Point(point.at, 100 / figures.candidates) for point in right]
    times = [_point(group, group.seconds) for group in groups if group.seconds is not None]
    series = [Series("people", times, "s0")]
    if line is not None and times:
        ends = [
            Point(p.at, line.intercept + line.slope.value * p.at) for p in (times[0], times[-1])
        ]
        series.append(Series("fitted line", ends, LINE))
    for chart in (
        curves(
            [Series("people", right, "s0"), Series("chance", chance, LINE)],
            "Right answers by angle",
            "percent",
            top=100,
        ),
        curves(series, "Time of right answers by angle", "seconds"),
    ):
        if chart is not None:
            yield chart


def _point(group: Group, estimate: Estimate, scale: float = 1) -> Point:
    """Return an estimate in the middle of a group's range of angles."""
    ends = (None if end is None else scale * end for end in (estimate.low, estimate.high))
    middle = sum(map(float, group.name.split("-"))) / 2
    return Point(middle, scale * estimate.value, *ends)


def _notes(figures: Figures) -> Sequence[str]:
    """Return what a reader has to know."""
    return [
        "Only participants who finished count, and only the questions after the calibration."
        " Intervals by kind and by angle take participants as the sample.",
        f"Times are from when the pictures showed to the answer, by the browser's clock;"
        f" {figures.timed} of {figures.finished * figures.questions} answers have one. Answers"
        " after a reload of their page have none.",
        "The line fits differences from each participant's own mean; its interval takes"
        " participants as the sample.",
        CONFLICT,
        SHAPIRO,
    ]


def _percent(value: float) -> str:
    return f"{100 * value:.1f}"


def _ends(estimate: Estimate, scale: float = 100, digits: int = 1) -> str:
    """Return an interval, each end times `scale`."""
    if estimate.low is None or estimate.high is None:
        return NONE
    return f"[{scale * estimate.low:.{digits}f}, {scale * estimate.high:.{digits}f}]"


def _p_value(p: float | None) -> str:
    return NONE if p is None else "< 0.0001" if p < 1e-4 else f"{p:.4f}"
