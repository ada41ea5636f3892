"""The figures of people's answers as tables of text, for terminals and pages, and as JSON."""

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict

from metrics.people.figures import Figures, Group
from metrics.people.intervals import CONFIDENCE, Estimate, Line
from metrics.people.references import CONFLICT, SHAPIRO
from scenegen.common.text_table import laid_out, printable

FORMAT_NAME, FORMAT_VERSION = "pix2shape-bench/quiz-report", "1.0"
NONE = "-"
BAR = 40  # characters of the longest bar
Table = tuple[str, Sequence[Sequence[str]]]


def text_report(figures: Figures) -> str:
    """Return all tables, each with its title, and the notes."""
    tables = [*summary_tables(figures), histogram_table(figures), *group_tables(figures)]
    lines = [head(figures), *laid_out(tables, as_markdown=False), ""]
    return "\n".join(map(printable, [*lines, *(f"note: {note}" for note in notes(figures))]))


def to_json(figures: Figures) -> str:
    """Return JSON whose keys are the attributes of `Figures` and of what is in it."""
    content = {"format": FORMAT_NAME, "format_version": FORMAT_VERSION, "confidence": CONFIDENCE}
    return json.dumps(
        {**content, **asdict(figures), "notes": notes(figures)}, indent=2, allow_nan=False
    ) + "\n"  # fmt: skip


def head(figures: Figures) -> str:
    """Return who answered what."""
    people = f"{figures.finished} participants finished of {figures.begun} who began"
    asked = f"{figures.questions} questions each, {figures.distinct} different ones"
    return f"{people}; {asked}, with {figures.candidates} answers"


def summary_tables(figures: Figures) -> Iterator[Table]:
    """Yield accuracy, what stands beside it, the tests, and the line of response times."""
    both = (
        ("of participants", figures.accuracy),
        ("of participants and questions", figures.crossed),
    )
    rows = [("accuracy in percent", "value", "95% interval")]
    rows += [(f"mean, sample {name}", percent(one.value), ends(one)) for name, one in both]
    if figures.deviation is not None:
        rows.append(("standard deviation of participants", percent(figures.deviation), ""))
    yield "Accuracy", rows
    yield (
        "Beside it",
        [
            ("accuracy in percent", "value", "where it comes from"),
            *((one.name, percent(one.value), one.note) for one in figures.references),
        ],
    )
    yield "Tests", list(_tests(figures))
    if figures.line is not None:
        yield "Time of right answers over the angle between views", line_rows(figures.line)


def _tests(figures: Figures) -> Iterator[tuple[str, ...]]:
    yield "test", "of", "difference in points", "statistic", "p"
    for test in figures.tests:
        statistic = NONE if test.t is None else f"t({test.degrees}) = {test.t:.2f}"
        difference = f"{100 * test.difference.value:+.1f} {ends(test.difference)}"
        against = f"people against {test.against}, {percent(test.other)}"
        yield "Student, one sample", against, difference, statistic, chance_of(test.p)
    statistic, p = (NONE, NONE)
    if figures.shapiro is not None:
        statistic, p = f"W = {figures.shapiro[0]:.4f}", chance_of(figures.shapiro[1])
    yield "Shapiro-Wilk", "scores are normally distributed", "", statistic, p


def line_rows(line: Line) -> list[tuple[str, ...]]:
    """Return the slope and its interval, per degree and as speed, and the intercept."""
    slope = line.slope
    rows = [
        ("", "value", "95% interval"),
        ("slope, milliseconds per degree", f"{1000 * slope.value:.1f}", ends(slope, 1000)),
        ("intercept, seconds", f"{line.intercept:.2f}", ""),
    ]
    if slope.value > 0:
        rows.append(("speed, degrees per second", f"{1 / slope.value:.0f}", ""))
    return [*rows, ("right answers with a time", str(line.answers), "")]


def histogram_table(figures: Figures) -> Table:
    """Return how many participants had how many right answers, with bars."""
    most = max(figures.histogram)
    rows = [("right answers", "participants", "")]
    low = figures.histogram.index(next(n for n in figures.histogram if n))
    for right, count in enumerate(figures.histogram):
        if right >= low:
            rows.append((str(right), str(count), "#" * math.ceil(BAR * count / max(most, BAR))))
    while rows[-1][1] == "0":
        rows.pop()
    return "Participants by their number of right answers", rows


def group_tables(figures: Figures) -> Iterator[Table]:
    """Yield accuracy and time by kind, and by angle."""
    for title, first, groups in (
        ("By kind of question", "kind", figures.by_kind),
        ("By angle between the views", "degrees", figures.by_angle),
    ):
        if groups:
            yield title, list(_group_rows(first, groups, with_floor=first == "kind"))


def _group_rows(first: str, groups: Sequence[Group], with_floor: bool) -> Iterator[tuple[str, ...]]:
    more = ("floor", "slope, ms per degree") if with_floor else ()
    names = ("answers", "right in percent", "95% interval", "seconds if right", "95% interval")
    yield first, *names, *more
    for one in groups:
        seconds = (NONE, NONE)
        if one.seconds is not None:
            seconds = f"{one.seconds.value:.2f}", ends(one.seconds, 1, 2)
        extra: tuple[str, ...] = ()
        if with_floor:
            slope = NONE
            if one.line is not None:
                slope = f"{1000 * one.line.slope.value:.1f} {ends(one.line.slope, 1000)}"
            extra = (NONE if one.floor is None else percent(one.floor), slope)
        yield (
            one.name,
            str(one.answers),
            percent(one.accuracy.value),
            ends(one.accuracy),
            *seconds,
            *extra,
        )


def notes(figures: Figures) -> list[str]:
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


def percent(value: float) -> str:
    """Return a fraction in percent."""
    return f"{100 * value:.1f}"


def ends(one: Estimate, scale: float = 100, digits: int = 1) -> str:
    """Return an interval, each end times `scale`."""
    if one.low is None or one.high is None:
        return NONE
    return f"[{scale * one.low:.{digits}f}, {scale * one.high:.{digits}f}]"


def chance_of(p: float | None) -> str:
    """Return a p-value."""
    return NONE if p is None else "< 0.0001" if p < 1e-4 else f"{p:.4f}"
