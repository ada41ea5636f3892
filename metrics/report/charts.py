"""Small charts as SVG text, for pages that load nothing from anywhere."""

from collections.abc import Sequence
from html import escape
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
WIDTH, HEIGHT = 360, 170
LEFT, RIGHT, TOP, BOTTOM = 46, 28, 24, 34
BINS = 30


def histogram(values: Array, title: str, unit: str) -> str:
    """Return the distribution of the values, (N,), with their mean and median marked."""
    finite = values[np.isfinite(values)]
    if not finite.size:
        return ""
    low, high = float(finite.min()), float(finite.max())
    if high - low <= 1e-12 * max(abs(high), abs(low), 1e-300):
        half = max(abs(low), 1e-3) / 2
        low, high = low - half, high + half
    counts, edges = np.histogram(finite, BINS, (low, high))
    x, y = _scale(low, high, LEFT, WIDTH - RIGHT), _scale(0, counts.max(), HEIGHT - BOTTOM, TOP)
    bars = "".join(
        f'<rect class="bar" x="{x(a):.1f}" y="{y(n):.1f}" width="{max(x(b) - x(a) - 0.6, 0.5):.1f}"'
        f' height="{y(0) - y(n):.1f}"><title>{a:.4g} to {b:.4g}: {n}</title></rect>'
        for a, b, n in zip(edges[:-1], edges[1:], counts.tolist(), strict=True)
    )
    marks = "".join(
        f'<line class="{name}" x1="{x(at):.1f}" x2="{x(at):.1f}" y1="{TOP}" y2="{y(0):.1f}">'
        f"<title>{name} {at:.4g}</title></line>"
        for name, at in (("mean", float(finite.mean())), ("median", float(np.median(finite))))
    )
    axis = _axis(x, (low, (low + high) / 2, high), unit) + _top_count(y, int(counts.max()))
    return _chart(title, bars + marks + axis)


def intervals(points: Sequence[tuple[float, float, float, float]], title: str, unit: str) -> str:
    """Return values with their intervals over an angle: (degrees, value, low, high) each."""
    if not points:
        return ""
    table = np.array(points, float)
    top = float(np.nanmax(table[:, 1:])) or 1.0
    degrees = table[:, 0].tolist()
    span = (min(degrees) - 4, max(degrees) + 4)
    x, y = _scale(*span, LEFT, WIDTH - RIGHT), _scale(0, top * 1.08, HEIGHT - BOTTOM, TOP)
    shown = []
    for degree, value, low, high in points:
        if np.isfinite(low) and np.isfinite(high):
            shown.append(_line("range", x(degree), y(low), x(degree), y(high)))
        shown.append(
            f'<circle class="dot" cx="{x(degree):.1f}" cy="{y(value):.1f}" r="4">'
            f"<title>{degree:g} degrees: {value:.4g} [{low:.4g}, {high:.4g}]</title></circle>"
        )
    labels = _axis(x, degrees, "degrees") + _text(LEFT - 4, y(top) + 4, f"{top:.3g}", "end")
    return _chart(f"{title} ({unit})", "".join(shown) + labels)


def _scale(low: float, high: float, start: float, stop: float) -> Any:
    return lambda value: start + (value - low) / ((high - low) or 1.0) * (stop - start)


def _chart(title: str, content: str) -> str:
    floor = _line("axis", LEFT, HEIGHT - BOTTOM, WIDTH - RIGHT, HEIGHT - BOTTOM)
    head = f'<text class="title" x="{LEFT}" y="14">{escape(title)}</text>'
    return (
        f'<svg role="img" aria-label="{escape(title)}" viewBox="0 0 {WIDTH} {HEIGHT}"'
        f' width="{WIDTH}" height="{HEIGHT}">{head}{floor}{content}</svg>'
    )


def _axis(x: Any, values: Sequence[float], unit: str) -> str:
    below = HEIGHT - BOTTOM + 14
    ticks = "".join(_text(x(value), below, f"{value:.3g}", "middle") for value in values)
    return ticks + _text((LEFT + WIDTH - RIGHT) / 2, HEIGHT - 4, unit, "middle")


def _top_count(y: Any, count: int) -> str:
    return _text(LEFT - 4, y(count) + 4, f"{count}", "end")


def _text(x: float, y: float, text: str, anchor: str) -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{escape(text)}</text>'


def _line(name: str, x1: float, y1: float, x2: float, y2: float) -> str:
    return f'<line class="{name}" x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}"/>'
