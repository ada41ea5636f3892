"""Charts as SVG for pages that load nothing, each with the numbers it shows as a table.

Numbers and units stand in the drawing; names, which come from other people's files and may be
long, stand only in the legend and in the table, where they can wrap.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup, escape
from numpy.typing import NDArray

from metrics.report.axes import Scale, apart, scale, span, tick_labels, width
from scenegen.common.text_table import number

Array = NDArray[np.float64]
Svg = Markup  # what a page shows without escaping it again
WIDTH, HEIGHT = 340, 200
TOP, BOTTOM, RIGHT = 14, 44, 12
STRIP_WIDTH, STRIP_HEIGHT = 150, 20
BINS = 30
COLOURS = 6  # of series; more share them
FLOOR = "floor"  # the class of what is no method


@dataclass(frozen=True)
class Point:
    """A value at some place, and its interval; the ends are NaN where there is none."""

    at: float
    value: float
    low: float = math.nan
    high: float = math.nan


@dataclass(frozen=True)
class Series:
    """A curve: its name, its points by rising `at`, and its class: "s0" to "s5", or `FLOOR`."""

    label: str
    points: Sequence[Point]
    kind: str


@dataclass(frozen=True)
class Chart:
    """A drawing, and what it shows as a table.

    Attributes:
        title: what is shown, with its unit.
        svg: the drawing.
        legend: a small drawing and the name of each series; empty where there is nothing to tell.
        head, rows: the table of all numbers, not escaped.
    """

    title: str
    svg: Svg
    legend: Sequence[tuple[Svg, str]]
    head: Sequence[str]
    rows: Sequence[Sequence[str]]


def kind_of(place: int) -> str:
    """Return the class of a method's series by its place among the methods."""
    return f"s{place % COLOURS}"


def histogram(values: Array, title: str, unit: str) -> Chart | None:
    """Return a chart of the distribution of values, (N,), with their mean and median marked.

    Values that are not finite are left out; there is no chart without any other.
    """
    finite = values[np.isfinite(values)]
    if not finite.size:
        return None
    ticks = span(finite.tolist())
    counts, edges = np.histogram(finite, BINS, (ticks[0], ticks[-1]))
    tall = [float(round(tick)) for tick in span([float(counts.max())]) if tick == round(tick)]
    frame = _Frame(ticks, tall, unit, "images")
    bars = "".join(
        f'<rect class="bar" x="{frame.x(a):.1f}" y="{frame.y(n):.1f}"'
        f' width="{max(frame.x(b) - frame.x(a) - 0.6, 0.5):.1f}"'
        f' height="{frame.y(0) - frame.y(n):.1f}"><title>{a:.4g} to {b:.4g}: {n}</title></rect>'
        for a, b, n in zip(edges[:-1], edges[1:], counts.tolist(), strict=True)
        if n
    )
    middles = (("mean", float(finite.mean())), ("median", float(np.median(finite))))
    marks = "".join(
        _line(name, frame.x(at), TOP, frame.x(at), frame.y(0), f"{name} {at:.4g}")
        for name, at in middles
    )
    rows = [
        (f"{number(a, edges[-1])} to {number(b, edges[-1])}", str(n))
        for a, b, n in zip(edges[:-1], edges[1:], counts.tolist(), strict=True)
    ]
    legend = [(_key(name), f"{name} {number(at)}") for name, at in middles]
    return Chart(title, frame.drawn(bars + marks, title), legend, (unit, "images"), rows)


def curves(
    series: Sequence[Series], title: str, unit: str, limits: tuple[float, float] = (0.0, math.inf)
) -> Chart | None:
    """Return a chart of values and their intervals over an angle in degrees, which begins at 0.

    Args:
        series: one or more; those without points are left out.
        title, unit: of the values.
        limits: which values are possible.
    """
    series = [one for one in series if one.points]
    if not series:
        return None
    degrees = sorted({point.at for one in series for point in one.points})
    ends = [
        end
        for one in series
        for point in one.points
        for end in (point.value, point.low, point.high)
    ]
    frame = _Frame(degrees, span(ends, *limits), "degrees", unit, from_zero=True)
    drawn = "".join(_curve(one, frame, place, len(series)) for place, one in enumerate(series))
    head = ("degrees", *(one.label for one in series))
    found = [{point.at: point for point in one.points} for one in series]
    rows = [
        (f"{at:g}", *(_told(points[at]) if at in points else "-" for points in found))
        for at in degrees
    ]
    legend = [(_key(one.kind), one.label) for one in series]
    return Chart(title, frame.drawn(drawn, title), legend, head, rows)


def strip(
    value: float, ends: tuple[float, float], marks: Sequence[tuple[str, float]], ticks: list[float]
) -> Svg:
    """Return a line that shows one value, its interval and other marks; no letters.

    It stands in a table beside the numbers, so it has no text of its own for who cannot see it.

    Args:
        ends: of the interval; NaN where there is none.
        marks: class and value of each further mark.
        ticks: of the axis, from `axes.span`.
    """
    x, middle = scale(ticks[0], ticks[-1], 6, STRIP_WIDTH - 6), STRIP_HEIGHT / 2
    drawn = [_line("axis", x(ticks[0]), middle, x(ticks[-1]), middle)]
    drawn += [
        _line("axis", x(tick), middle - 3, x(tick), middle + 3) for tick in _zero_and_ends(ticks)
    ]
    drawn += [_line(kind, x(at), 2, x(at), STRIP_HEIGHT - 2) for kind, at in marks]
    low, high = ends
    if math.isfinite(low) and math.isfinite(high):
        drawn.append(_line("range s0", x(low), middle, x(high), middle))
    drawn.append(_marker("s0", x(value), middle))
    return Svg(
        f'<svg class="strip" aria-hidden="true" viewBox="0 0 {STRIP_WIDTH} {STRIP_HEIGHT}"'
        f' width="{STRIP_WIDTH}" height="{STRIP_HEIGHT}">{"".join(drawn)}</svg>'
    )


def _zero_and_ends(ticks: list[float]) -> list[float]:
    return sorted({ticks[0], ticks[-1], min(max(0.0, ticks[0]), ticks[-1])})


class _Frame:
    """The axes of a chart, wide enough for their labels, and the scales between them."""

    def __init__(
        self, across: list[float], up: list[float], unit: str, unit_up: str, from_zero: bool = False
    ) -> None:
        self.labels_up, self.labels = tick_labels(up), tick_labels(across)
        if from_zero:  # angles as they are, at which the values stand
            self.labels = [f"{tick:g}" for tick in across]
        self.across, self.up, self.unit, self.unit_up = across, up, unit, unit_up
        self.left = max(10 + width(self.labels_up), 4 + width(self.labels[:1]) / 2)
        right = RIGHT + width(self.labels[-1:]) / 2
        first = 0.0 if from_zero else across[0]
        margin = 8.0 if from_zero else 0.0  # for marks at the ends
        self.x = scale(first, across[-1], self.left + margin, WIDTH - right)
        self.y: Scale = scale(up[0], up[-1], HEIGHT - BOTTOM, TOP)

    def drawn(self, content: str, title: str) -> Svg:
        """The whole chart: grid, axes, and what stands between them."""
        bottom, right = HEIGHT - BOTTOM, WIDTH - RIGHT
        parts = []
        for tick, label in zip(self.up, self.labels_up, strict=True):
            parts.append(_line("grid", self.left, self.y(tick), right, self.y(tick)))
            parts.append(_text(self.left - 5, self.y(tick) + 4, label, "end"))
        zero = self.y(min(max(0.0, self.up[0]), self.up[-1]))
        parts.append(_line("axis", self.left, zero, right, zero))
        parts.append(_line("axis", self.left, TOP, self.left, bottom))
        places = [self.x(tick) for tick in self.across]
        shown = apart(places, self.labels)
        parts += [_text(places[i], bottom + 18, self.labels[i], "middle") for i in shown]
        parts.append(_text((self.left + right) / 2, HEIGHT - 8, self.unit, "middle"))
        told = escape(f"Chart: {title}, {self.unit_up}. Its numbers are in the table that follows.")
        return Svg(  # what stands in it from elsewhere, title and units, is escaped
            f'<svg role="img" aria-label="{told}" viewBox="0 0 {WIDTH} {HEIGHT}"'
            f' width="{WIDTH}" height="{HEIGHT}">{"".join(parts)}{content}</svg>'
        )


def _curve(series: Series, frame: _Frame, place: int, count: int) -> str:
    """The line, intervals and markers of a series; a little aside, so that none hides another."""
    aside = 3.0 * (place - (count - 1) / 2) if count <= COLOURS else 0.0
    at = [(frame.x(p.at) + aside, frame.y(p.value)) for p in series.points]
    path = " ".join(f"{x:.1f},{y:.1f}" for x, y in at)
    return "".join(
        [
            f'<polyline class="curve {series.kind}" points="{path}"/>',
            *_ranges(series, [x for x, _ in at], frame),
            *(
                _marker(series.kind, x, y, f"{point.at:g} degrees: {_told(point)}")
                for (x, y), point in zip(at, series.points, strict=True)
            ),
        ]
    )


def _ranges(series: Series, across: Sequence[float], frame: _Frame) -> Iterator[str]:
    for x, point in zip(across, series.points, strict=True):
        if math.isfinite(point.low) and math.isfinite(point.high):
            yield _line(f"range {series.kind}", x, frame.y(point.low), x, frame.y(point.high))


def _told(point: Point) -> str:
    if not (math.isfinite(point.low) and math.isfinite(point.high)):
        return number(point.value)
    ends = f"[{number(point.low, point.value)}, {number(point.high, point.value)}]"
    return f"{number(point.value)} {ends}"


def _key(kind: str) -> Svg:
    """The drawing of a series in a legend."""
    inside = _line(f"curve {kind}", 1, 7, 27, 7)
    if kind in ("mean", "median"):
        inside = _line(kind, 14, 0, 14, 14)
    else:
        inside += _marker(kind, 14, 7)
    return Svg(f'<svg aria-hidden="true" viewBox="0 0 28 14" width="28" height="14">{inside}</svg>')


_SHAPES = {
    "s0": "M-4,0a4,4 0 1,0 8,0a4,4 0 1,0 -8,0z",
    "s1": "M-3.5,-3.5h7v7h-7z",
    "s2": "M0,-4.5l4.5,8h-9z",
    "s3": "M0,-5l5,5l-5,5l-5,-5z",
    "s4": "M0,4.5l4.5,-8h-9z",
    "s5": "M-4,-1.5h2.5v-2.5h3v2.5h2.5v3h-2.5v2.5h-3v-2.5h-2.5z",
}  # so that series differ by more than their colours


def _marker(kind: str, x: float, y: float, title: str = "") -> str:
    if kind not in _SHAPES:
        return ""
    told = f"<title>{escape(title)}</title>" if title else ""
    move = f'transform="translate({x:.1f} {y:.1f})"'
    return f'<path class="dot {kind}" d="{_SHAPES[kind]}" {move}>{told}</path>'


def _text(x: float, y: float, text: str, anchor: str) -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{escape(text)}</text>'


def _line(name: str, x1: float, y1: float, x2: float, y2: float, title: str = "") -> str:
    told = f"<title>{escape(title)}</title>" if title else ""
    ends = f'x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}"'
    return f'<line class="{name}" {ends}>{told}</line>'
