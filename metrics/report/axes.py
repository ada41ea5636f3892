"""Axes of charts: where they begin and end, and which numbers stand beside them.

Lengths are in units of a chart's view box, in which its letters are 11 high.
"""

import itertools
import math
from collections.abc import Callable, Iterable

Scale = Callable[[float], float]
MOST_TICKS = 6
LETTER = 7.2  # width of a digit at most


def span(values: Iterable[float], smallest: float = 0.0, largest: float = math.inf) -> list[float]:
    """Return the ticks of an axis that shows these values; it ends at the first and the last one.

    The axis begins at 0, so that lengths compare, or below it where a value is negative. It goes
    not beyond `smallest` and `largest`, the limits of what is shown, unless a value does. Values
    that are not finite do not count.
    """
    finite = [value for value in values if math.isfinite(value)]
    low, high = min([0.0, *finite]), max([0.0, *finite])
    if low == high:
        high = 1.0 if largest == math.inf else largest
    step = _nice((high - low) / (MOST_TICKS - 2))
    first, last = math.floor(low / step + 1e-9), math.ceil(high / step - 1e-9)
    ticks = [i * step for i in range(first, last + 1)]
    if low >= smallest > ticks[0]:
        ticks[0] = smallest
    if high <= largest < ticks[-1]:
        ticks[-1] = largest
    return ticks


def _nice(step: float) -> float:
    """Return the least number of 1, 2 or 5 times a power of ten that is not below a step."""
    power = 10.0 ** math.floor(math.log10(step))
    return next(n * power for n in (1, 2, 5, 10) if n * power >= step * (1 - 1e-9))


def tick_labels(ticks: list[float]) -> list[str]:
    """Return numbers with as many decimals as tell them apart, all alike."""
    step = min((b - a for a, b in itertools.pairwise(ticks)), default=1.0)
    decimals = max(0, -math.floor(math.log10(step) + 1e-9)) if step > 0 else 0
    if decimals > 6 or max(map(abs, ticks)) >= 1e6:
        return [f"{tick:.3g}" for tick in ticks]
    return [f"{tick:.{decimals}f}".replace("-0", "0") if tick == 0 else f"{tick:.{decimals}f}"
            for tick in ticks]  # fmt: skip


def width(labels: Iterable[str]) -> float:
    """Return how wide the widest of some labels is at most."""
    return LETTER * max(map(len, labels), default=0)


def scale(low: float, high: float, start: float, stop: float) -> Scale:
    """Return the function that takes low to start, high to stop, and what is between evenly."""
    return lambda value: start + (value - low) / ((high - low) or 1.0) * (stop - start)


def apart(places: list[float], labels: list[str], between: float = 6.0) -> list[int]:
    """Return which labels, centred at rising places, can be shown without touching each other.

    The first and the last are shown; those between wherever there is room.
    """
    if not places:
        return []
    half = [LETTER * len(label) / 2 for label in labels]
    last = len(places) - 1
    shown = [0]
    for i in range(1, last + 1):
        room = places[i] - half[i] - between >= places[shown[-1]] + half[shown[-1]]
        if i == last:
            while shown and places[i] - half[i] - between < places[shown[-1]] + half[shown[-1]]:
                shown.pop()
            room = True
        if room:
            shown.append(i)
    return shown
