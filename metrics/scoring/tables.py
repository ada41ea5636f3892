"""The columns of a score file, which hold the scores of each image, question and object, checked.

Lists become arrays. What the columns say together with the rest of the file is left to `schema`.
"""

import re
import sys
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from metrics.measures.objects import LEAST_PIXELS
from metrics.scoring.metric_names import OBJECT_SCORES, Metric, UnknownMetricError, metric
from metrics.scoring.records import (
    ID_COLUMNS,
    OBJECT_COLUMNS,
    OPTIONAL_COLUMNS,
    SHAPE_COLUMN,
    ScoreFile,
)
from metrics.submissions.strict_json import LARGEST_WHOLE, refusal, shown

# Limits of the whole numbers about single objects: ids are int8 in rooms files.
OBJECT_LIMITS = {
    "row": (0, LARGEST_WHOLE),
    "object": (1, 127),
    "pixels": (LEAST_PIXELS, LARGEST_WHOLE),
}


def item_columns(stored: Mapping[str, Any], task: str, runs: int) -> dict[str, NDArray[Any]]:
    """Return the columns as arrays, (N,) each."""
    required, optional = ID_COLUMNS[task], OPTIONAL_COLUMNS[task]
    for name in required:
        if name not in stored:
            raise refusal(f"items.{name}", "no such key", "it to be there")
    columns: dict[str, NDArray[Any]] = {}
    for name, values in stored.items():
        place = f"items.{name:.60}"
        if name in required or name in optional:
            least = 0 if name in required else -1
            columns[name] = _column(place, values, np.int64, least, LARGEST_WHOLE)
        else:
            known = known_metric(place, name, task)
            columns[name] = _column(place, values, np.float64, known.smallest, known.largest)
    ids = columns[required[0]]
    _check_lengths("items", columns, required[0])
    if not len(ids):
        raise refusal("items", "no entries", "at least one in each column")
    names, times = np.unique(ids, return_counts=True)
    if len(names) < len(ids):
        twice = names[int(np.argmax(times > 1))]
        raise refusal(f"items.{required[0]}", f"{twice} twice", "each once")
    answers = columns.get("iqtt_accuracy")
    if answers is not None and runs == 1:
        wrong = ~np.isin(answers, (0.0, 1.0))
        if wrong.any():
            found = repr(float(answers[wrong][0]))
            raise refusal("items.iqtt_accuracy", found, "0 or 1 for one run")
    return columns


def object_columns(file: ScoreFile) -> dict[str, NDArray[Any]]:
    """Return the columns of single objects as arrays, (M,) each."""
    columns: dict[str, NDArray[Any]] = {}
    for name, values in file.objects.items():
        place = f"objects.{name:.60}"
        if name == SHAPE_COLUMN:
            columns[name] = _shapes(place, values)
        elif name in OBJECT_COLUMNS:
            columns[name] = _column(place, values, np.int64, *OBJECT_LIMITS[name])
        elif name not in OBJECT_SCORES:
            raise refusal(place, "no score of single objects", f"one of {', '.join(OBJECT_SCORES)}")
        else:
            columns[name] = _column(place, values, np.float64, 0, metric(name).largest)
            if np.isnan(columns[name]).any():
                raise refusal(place, "null", "numbers")
    for name in (*OBJECT_COLUMNS, SHAPE_COLUMN, *OBJECT_SCORES) if columns else ():
        if name not in columns:
            raise refusal(f"objects.{name}", "no such key", "it to be there")
    if not columns:
        return columns
    _check_lengths("objects", columns, "row")
    row, object_id = columns["row"], columns["object"]
    unknown = ~np.isin(row, file.ids)
    if unknown.any():
        i = int(np.argmax(unknown))
        raise refusal(f"objects.row[{i}]", str(row[i]), "a row of items")
    names, times = np.unique(np.stack([row, object_id], axis=-1), axis=0, return_counts=True)
    if len(names) < len(row):
        twice = names[int(np.argmax(times > 1))]
        raise refusal("objects.object", f"{twice[1]} twice in row {twice[0]}", "each once")
    return columns


def _shapes(place: str, values: Any) -> NDArray[Any]:
    """Return a list of names of shapes as an array of texts."""
    if not isinstance(values, list):
        raise refusal(place, shown(values), "a list of texts")
    for i, value in enumerate(values):
        if not (isinstance(value, str) and re.fullmatch(r"[^\s].{0,59}", value)):
            raise refusal(f"{place}[{i}]", shown(value), "a name of 1 to 60 characters")
    return np.array(values, dtype=object)


def check_presence(file: ScoreFile) -> None:
    """Raise JsonError unless exactly the rows with such a score have a number in its column."""
    seen = {"objects": np.isin(file.ids, file.objects.get("row", ())), "relief": None}
    for name, column in file.items.items():
        kind = metric(name).lacking if column.dtype == np.float64 else ""
        if not kind:
            continue
        there = ~np.isnan(column)
        expected = seen[kind]
        if expected is None:
            seen[kind] = there
            continue
        wrong = there != expected
        if wrong.any():
            i = int(np.argmax(wrong))
            told = "a number, as in the other scores of this kind" if expected[i] else "null"
            raise refusal(f"items.{name}[{i}]", "a number" if there[i] else "null", told)


def _check_lengths(place: str, columns: Mapping[str, NDArray[Any]], first: str) -> None:
    """Raise JsonError unless all columns are as long as the first one."""
    count = len(columns[first])
    for name, column in columns.items():
        if len(column) != count:
            raise refusal(f"{place}.{name}", f"{len(column)} entries", f"{count}, as in {first}")


def _column(place: str, values: Any, dtype: type[Any], least: float, most: float) -> NDArray[Any]:
    """Return a list of numbers within limits as an array; null becomes NaN where NaN can be."""
    if not isinstance(values, list):
        raise refusal(place, shown(values), "a list of numbers")
    floats = dtype is np.float64
    kinds = {int, float, type(None)} if floats else {int}
    try:
        column = np.array(values, dtype) if set(map(type, values)) <= kinds else None
    except OverflowError:
        column = None
    if column is not None:
        outside = np.isinf(column) | (column < least) | (column > most)
        if not outside.any():
            return column
    for i, value in enumerate(values):
        number = type(value) in kinds - {type(None)} and abs(value) <= sys.float_info.max
        if not (floats and value is None) and not (number and least <= value <= most):
            expected = f"a {'finite' if floats else 'whole'} number {within(least, most)}"
            raise refusal(f"{place}[{i}]", shown(value), expected)
    raise AssertionError("an array of numbers within limits can be made")


def within(least: float, most: float) -> str:
    """Return limits in words."""
    return f"from {least:g} to {most:g}" if np.isfinite(most) else f"from {least:g}"


def known_metric(place: str, name: str, task: str) -> Metric:
    """Return what a score is. Raises JsonError for a name that is no score of the task."""
    try:
        known = metric(name)
    except UnknownMetricError:
        known = None
    if known is None or known.task != task:
        raise refusal(place, f"no score of task {task!r}", "a name listed in docs/scores.md")
    return known
