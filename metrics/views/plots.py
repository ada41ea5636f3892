"""Charts of pages, drawn by matplotlib as SVG.

Names of methods come from strangers' files and may be long, so they stand in the page's legend and
tables and never in a drawing. The same numbers give the same bytes.
"""

import base64
import io
import math
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from metrics.views.table import Table, make_table
from scenegen.common.text_table import number, with_interval

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]
BINS = 30
LINE = "line"  # kind of what is no method
# Colour and marker by the kind of a series, as in templates/style.css.
KINDS = {
    "s0": ("#0b63b0", "o"),
    "s1": ("#b34700", "s"),
    "s2": ("#00735a", "^"),
    "s3": ("#8a3b8f", "D"),
    "s4": ("#7a5c00", "v"),
    "s5": ("#4a4f57", "P"),
    LINE: ("#6b7280", ""),
}
COLOURS = len(KINDS) - 1  # of methods; more share them
_STYLE: dict[Any, Any] = {
    "font.size": 8,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.grid": True,
    "axes.grid.axis": "y",
    "axes.axisbelow": True,
    "grid.color": "#d5dae0",
    "grid.linewidth": 0.6,
    "svg.fonttype": "none",
    "svg.hashsalt": "pix2shape-bench",
}
_STRIP_STYLES = {"floor": "-", "zero": "-", "chance": ":"}  # of lines; others are dashed


@dataclass(frozen=True)
class Point:
    """A value at some place, and its interval; the ends are None where there is none."""

    at: float
    value: float
    low: float | None = None
    high: float | None = None


@dataclass(frozen=True)
class Series:
    """A curve: its name, its points by rising `at`, and its kind, a key of `KINDS`."""

    label: str
    points: Sequence[Point]
    kind: str


@dataclass(frozen=True)
class Chart:
    """A drawing.

    Attributes:
        picture: an SVG image, as a data URL.
        legend: kind and name of each series; empty where the title says enough.
        table: the numbers that are drawn; None where they stand elsewhere on the page.
    """

    title: str
    picture: str
    legend: Sequence[tuple[str, str]] = ()
    table: Table | None = None


def kind_of(place: int) -> str:
    """Return the kind of a method's series by its place among the methods."""
    return f"s{place % COLOURS}"


def histogram(values: Array, title: str, unit: str) -> Chart | None:
    """Return a chart of the distribution of values, (N,), with their mean and median.

    Values that are not finite are left out; there is no chart without any other.
    """
    finite = values[np.isfinite(values)]
    if not finite.size:
        return None
    limits = (min(0.0, float(finite.min())), max(0.0, float(finite.max())))
    counts, edges = np.histogram(finite, BINS, limits)
    middles = (("mean", float(finite.mean()), "-"), ("median", float(np.median(finite)), "--"))
    with _drawing() as (figure, axes):
        axes.stairs(counts, edges, fill=True, color="#5b8fbf")
        for (name, place, style), kind in zip(middles, ("s1", "s2"), strict=True):
            label = f"{name} {number(place)}"
            axes.axvline(place, color=KINDS[kind][0], linestyle=style, label=label)
        axes.set(xlabel=unit, ylabel="images")
        axes.locator_params(axis="x", nbins=6)
        figure.legend(loc="outside upper left", ncols=2, frameon=False)
        picture = _svg(figure)
    return Chart(title, picture)


def curves(
    series: Sequence[Series], title: str, unit: str, top: float | None = None
) -> Chart | None:
    """Return a chart of values and their intervals over an angle in degrees, which begins at 0.

    Args:
        series: one or more; those without points are left out.
        title, unit: of the values.
        top: where the axis of the values ends.
    """
    series = [line for line in series if line.points]
    if not series:
        return None
    degrees = sorted({point.at for line in series for point in line.points})
    with _drawing() as (figure, axes):
        for place, line in enumerate(series):
            _draw_curve(axes, line, place - (len(series) - 1) / 2)
        axes.set(xlabel="degrees", ylabel=unit)
        axes.set_xticks(_apart(degrees))
        axes.set_xlim(left=min(0.0, axes.get_xlim()[0]))
        axes.set_ylim(min(0.0, axes.get_ylim()[0] if _lowest(series) < 0.0 else 0.0), top)
        picture = _svg(figure)
    by_degrees = [{point.at: point for point in line.points} for line in series]
    rows = [
        (f"{at:g}", *(_in_words(points[at]) if at in points else "-" for points in by_degrees))
        for at in degrees
    ]
    head = ("degrees", *(line.label for line in series))
    legend = [(line.kind, line.label) for line in series]
    return Chart(title, picture, legend, make_table(f"Numbers of {title}", head, rows))


def _draw_curve(axes: "Axes", line: Series, aside: float) -> None:
    """Draw a series a little aside, so that no interval hides another."""
    color, marker = KINDS[line.kind]
    ends = [(p.at, p.value, p.low, p.high) for p in line.points]
    at, value, low, high = np.array(ends, float).T  # None is NaN
    at = at + (0.6 * aside if line.kind != LINE else 0.0)
    style = "--" if line.kind == LINE else "-"
    axes.plot(at, value, style, color=color, marker=marker, markersize=4, linewidth=1.2)
    bounded = np.isfinite(low) & np.isfinite(high)
    axes.vlines(at[bounded], low[bounded], high[bounded], color=color, linewidth=1.6)


def _lowest(series: Sequence[Series]) -> float:
    ends = [(p.value, p.low, p.high) for line in series for p in line.points]
    return float(np.nanmin(np.array(ends, float)))


def _apart(degrees: Sequence[float]) -> list[float]:
    """Return those of some rising degrees whose labels do not touch."""
    ticks = [degrees[-1]]
    for tick in reversed(degrees):
        if ticks[-1] - tick >= 0.06 * max(degrees[-1], 1.0):
            ticks.append(tick)
    return ticks[::-1]


def _in_words(point: Point) -> str:
    value, interval = with_interval(point.value, point.low, point.high)
    return value if interval == "-" else f"{value} {interval}"


def strip(
    point: Point, marks: Sequence[tuple[str, float]], others: Sequence[float | None] = (),
    limits: tuple[float, float] = (-math.inf, math.inf),
) -> tuple[str, str]:  # fmt: skip
    """Return a line with one value, its interval and marks, as a data URL; and its ends in words.

    It stands in a table beside the numbers, so it has no letters. The line begins at 0 or below.

    Args:
        point: the value; `at` does not count.
        marks: "floor", "zero", "chance" or the kind of a series, and where its mark stands.
        others: further values that the line shall hold.
        limits: which values are possible; the line goes no farther.
    """
    load_matplotlib()
    from matplotlib.ticker import MaxNLocator

    ends = [point.value, point.low, point.high, *others, *(at for _, at in marks)]
    shown = [end for end in ends if end is not None and math.isfinite(end)]
    ticks = MaxNLocator(4).tick_values(min(0.0, *shown), max(0.0, *shown))
    low, high = max(float(ticks[0]), limits[0]), min(float(ticks[-1]), limits[1])
    with _drawing(1.6, 0.22, layout=None) as (figure, axes):
        axes.set_axis_off()
        axes.set_position((0, 0, 1, 1))
        axes.set(xlim=(low - 0.03 * (high - low), high + 0.03 * (high - low)), ylim=(-1, 1))
        axes.plot((low, high), (0, 0), color="#57606a", linewidth=0.8)
        axes.plot((low, 0.0, high), (0, 0, 0), "|", color="#57606a", markersize=6)
        for kind, at in marks:
            color = KINDS.get(kind, KINDS[LINE])[0]
            axes.axvline(at, color=color, linestyle=_STRIP_STYLES.get(kind, "--"), linewidth=1.5)
        if point.low is not None and point.high is not None:
            axes.plot((point.low, point.high), (0, 0), color=KINDS["s0"][0], linewidth=2)
        axes.plot(point.value, 0, "o", color=KINDS["s0"][0], markersize=5)
        picture = _svg(figure)
    return picture, f"{low:.4g} to {high:.4g}"


def load_matplotlib() -> Any:
    """Return matplotlib. A backend in the environment does not count: none is used here.

    Notebooks and IDEs leave MPLBACKEND behind, and a name that matplotlib does not know would end
    its import.
    """
    backend = os.environ.pop("MPLBACKEND", None)
    try:
        import matplotlib
    finally:
        if backend is not None:
            os.environ["MPLBACKEND"] = backend
    return matplotlib


@contextmanager
def _drawing(
    width: float = 3.6,
    height: float = 2.1,
    layout: Literal["constrained"] | None = "constrained",
) -> Iterator[tuple[Any, "Axes"]]:
    """Give a figure of that many inches and its axes; settings of the user do not count."""
    matplotlib = load_matplotlib()
    from matplotlib.figure import Figure

    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(_STYLE)
        figure = Figure(figsize=(width, height), layout=layout)
        yield figure, figure.add_subplot()


def _svg(figure: Any) -> str:
    stream = io.BytesIO()
    metadata = {"Date": None, "Creator": None}
    figure.savefig(stream, format="svg", transparent=True, metadata=metadata)
    return "data:image/svg+xml;base64," + base64.b64encode(stream.getvalue()).decode()
