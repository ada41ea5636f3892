"""Charts of people's answers as SVG: bars by name, and times over an angle with a line."""

from collections.abc import Mapping, Sequence

import numpy as np
from markupsafe import Markup, escape

from metrics.report.axes import Scale, apart, scale

Svg = Markup  # what a page shows without escaping it again
WIDTH, HEIGHT = 360, 170
LEFT, RIGHT, TOP, BOTTOM = 46, 28, 24, 34


def bars(counts: Mapping[str, float], title: str, unit: str) -> Svg:
    """Return a chart with a bar for each name; `unit` says what the names are.

    What is above each bar is its number, so that the chart needs no other axis. Names and numbers
    that would touch each other are left out; the title of each bar has both.
    """
    if not counts:
        return Svg()
    width = (WIDTH - LEFT - RIGHT) / len(counts)
    y = scale(0, max(*counts.values(), 1e-300), HEIGHT - BOTTOM, TOP + 12)
    numbers = [f"{v:,.0f}" if v >= 100 else f"{v:.3g}" for v in counts.values()]
    middles = [LEFT + (i + 0.5) * width for i in range(len(counts))]
    named, numbered = (set(apart(middles, words)) for words in (list(counts), numbers))
    shown: list[str] = []
    for i, (name, value) in enumerate(counts.items()):
        left = LEFT + i * width
        place = f'x="{left + 1:.1f}" y="{y(value):.1f}" width="{max(width - 2, 1):.1f}"'
        shown += (
            f'<rect class="bar" {place} height="{y(0) - y(value):.1f}">'
            f"<title>{escape(name)}: {numbers[i]}</title></rect>",
            _text(middles[i], HEIGHT - BOTTOM + 14, name, "middle") if i in named else "",
            _text(middles[i], y(value) - 3, numbers[i], "middle")
            if value and i in numbered
            else "",
        )
    shown.append(_text((LEFT + WIDTH - RIGHT) / 2, HEIGHT - 4, unit, "middle"))
    return _chart(title, "".join(shown))


def intervals(
    points: Sequence[tuple[float, float, float, float]],
    title: str,
    unit: str,
    line: tuple[float, float] | None = None,
) -> Svg:
    """Return a chart of values and their intervals over an angle.

    Args:
        points: degrees, value, low and high end of each; the ends are NaN where there is none.
        title, unit: of the values.
        line: intercept and slope per degree of a line to draw through them.
    """
    if not points:
        return Svg()
    table = np.array(points, float)
    top, bottom = float(np.nanmax(table[:, 1:])) or 1.0, min(0.0, float(np.nanmin(table[:, 1:])))
    degrees = table[:, 0].tolist()
    x = scale(min(degrees) - 4, max(degrees) + 4, LEFT, WIDTH - RIGHT)
    y = scale(bottom * 1.08, top + 0.08 * abs(top), HEIGHT - BOTTOM, TOP)
    shown = []
    for degree, value, low, high in points:
        if np.isfinite(low) and np.isfinite(high):
            shown.append(_line("range s0", x(degree), y(low), x(degree), y(high)))
        shown.append(
            f'<circle class="dot s0" cx="{x(degree):.1f}" cy="{y(value):.1f}" r="4">'
            f"<title>{degree:g} degrees: {value:.4g} [{low:.4g}, {high:.4g}]</title></circle>"
        )
    if line is not None:
        first, last = min(degrees), max(degrees)
        ends = [line[0] + line[1] * degree for degree in (first, last)]
        shown.append(_line("median", x(first), y(ends[0]), x(last), y(ends[1]), "fitted line"))
    axes = _axes(x, degrees, "degrees", y, top, f"{top:.3g}")
    if bottom < 0:
        axes += _line("axis", LEFT, y(0), WIDTH - RIGHT, y(0)) + _text(
            LEFT - 4, y(0) + 4, "0", "end"
        )
    return _chart(f"{title} ({unit})", "".join(shown) + axes)


def _chart(title: str, content: str) -> Svg:
    floor = _line("axis", LEFT, HEIGHT - BOTTOM, WIDTH - RIGHT, HEIGHT - BOTTOM)
    head = f'<text class="title" x="{LEFT}" y="14">{escape(title)}</text>'
    return Svg(  # what stands in it from elsewhere, titles and units, is escaped
        f'<svg role="img" aria-label="{escape(title)}" viewBox="0 0 {WIDTH} {HEIGHT}"'
        f' width="{WIDTH}" height="{HEIGHT}">{head}{floor}{content}</svg>'
    )


def _axes(x: Scale, ticks: Sequence[float], unit: str, y: Scale, top: float, label: str) -> str:
    """Ticks and the unit below, and one label at the height of the value `top`."""
    below = "".join(_text(x(tick), HEIGHT - BOTTOM + 14, f"{tick:.3g}", "middle") for tick in ticks)
    below += _text((LEFT + WIDTH - RIGHT) / 2, HEIGHT - 4, unit, "middle")
    return below + _text(LEFT - 4, y(top) + 4, label, "end")


def _text(x: float, y: float, text: str, anchor: str) -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{escape(text)}</text>'


def _line(name: str, x1: float, y1: float, x2: float, y2: float, title: str = "") -> str:
    told = f"<title>{title}</title>" if title else ""
    ends = f'x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}"'
    return f'<line class="{name}" {ends}>{told}</line>'
