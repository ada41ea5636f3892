"""A hint on numbers that stand for "no value", such as 1e10, 65504 or 0, among depths."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from metrics.measured.reader import Images, padded_size
from metrics.submissions.problems import HINT, Problem, first_ids
from metrics.submissions.reader import RoomPredictions
from metrics.submissions.rules import LARGEST
from scenegen.common.errors import FileFormatError

Array = NDArray[Any]
ROWS = 256  # that are looked at, spread evenly; fewer of large images
MOST_PIXELS = ROWS * 2**16  # of all of them
FEWEST_ROWS = 24
FAR = 10.0  # spreads of the other values by which a number that several pixels share stands out
VERY_FAR = 10_000.0  # the same, of a number at a single pixel


def no_value_hints(predictions: RoomPredictions, truth: Images) -> list[Problem]:
    """Return a hint where pixels of true surfaces hold a number that stands for "no value"."""
    entries = np.flatnonzero((predictions.rows >= 0) & (predictions.rows < len(truth)))
    rows = max(FEWEST_ROWS, min(ROWS, MOST_PIXELS // math.prod(padded_size(truth))))
    spread = np.linspace(0, max(0, len(entries) - 1), rows).astype(np.int64)
    zero_is_none = predictions.kind != "disparity" and predictions.alignment != "scale_shift"
    images: dict[float, list[tuple[int, int]]] = {}  # by mark, its rows and their pixels
    for entry in entries[np.unique(spread)].tolist() if len(entries) else []:
        row = int(predictions.rows[entry])
        try:
            disparity = predictions.kind == "disparity"
            values = predictions.geometry(entry) if disparity else predictions.depth(entry)
        except FileFormatError:
            continue
        mark = no_value_mark(values.ravel(), zero_is_none)
        if mark is not None:
            surface = np.isfinite(truth.read("depth", row)).ravel()
            mark = no_value_mark(values.ravel()[surface], zero_is_none)
        if mark is not None:
            images.setdefault(mark[0], []).append((row, mark[1]))
    if not images:
        return []
    value, found = max(images.items(), key=lambda item: len(item[1]))
    pixels, ids = sum(count for _, count in found), [row for row, _ in found]
    text = (
        f"{value:g} at {pixels:,} pixels of {len(ids)} images looks like a marker of invalid"
        " pixels;"
        f" use bench import --missing nearest --invalid with the number in your files"
    )
    expected = "a value of the surface at each pixel"
    return [Problem(predictions.kind, HINT, expected, text, first_ids(ids))]


def no_value_mark(values: Array, zero_is_none: bool) -> tuple[float, int] | None:
    """Return the number among values (N,) that stands for none, and how often it is there.

    It is the largest or the smallest of them, far from all others: a number that several pixels
    share exactly, or a huge one. Where `zero_is_none`, 0 is one, and a shared number below 0.
    Of a constant image only 0 can be told.
    """
    values = values[np.abs(values) <= LARGEST]
    if not len(values):
        return None
    for value in (float(values.max()), float(values.min())):
        others = values[values != value]
        count = len(values) - len(others)
        if not len(others):
            return (value, count) if zero_is_none and value == 0.0 else None
        low, middle, high = np.quantile(others, (0.05, 0.5, 0.95)).tolist()
        if zero_is_none and middle > 0.0 and (value == 0.0 or (value < 0.0 and count > 1)):
            return value, count
        away = abs(value - middle) / (max(abs(middle), high - low) or np.inf)
        if away > (FAR if count > 1 else VERY_FAR):
            return value, count
    return None
