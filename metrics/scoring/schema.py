"""The content of a score file, held against `records`, and whether its numbers agree.

This module imports pydantic, so the commands import it only when they run.
"""

import sys
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from metrics.scoring.metric_names import Metric, UnknownMetricError, metric
from metrics.scoring.records import GROUPINGS, ID_COLUMNS, OPTIONAL_COLUMNS, Score, ScoreFile, Task
from metrics.submissions.strict_json import LARGEST_WHOLE, refusal, shown, validated

AGREEMENT = 1e-9  # of a score with the mean of its column, relative


@dataclass(frozen=True)
class Head:
    """The keys that say how to read the others."""

    format: Literal["pix2shape-bench/scores"]
    format_version: Annotated[str, Field(pattern=r"^1\.[0-9]{1,4}$")]
    task: Task


def parse_scores(content: Any) -> ScoreFile:
    """Check the parsed JSON of a score file. Raises JsonError at the first thing that is wrong."""
    task = validated(Head, content).task
    body = {key: value for key, value in content.items() if key not in ("format", "format_version")}
    foreign = {"path"}.union(*GROUPINGS.values()).difference(GROUPINGS[task])
    for name in foreign.intersection(body):
        raise refusal(name, "an unknown key", "no key of this name")
    found = validated(ScoreFile, body)
    if task == "iqtt":
        if found.alignment != "none":
            raise refusal("alignment", repr(found.alignment), "'none'")
        if "chamfer_floor" in body["meta"]:
            raise refusal("meta.chamfer_floor", "an unknown key", "no key of this name")
    if len({submission.sha256 for submission in found.meta.submissions}) < found.runs:
        raise refusal("meta.submissions", "the same sha256 twice", "each submission once")
    found = replace(found, items=_items(found.items, task, found.runs))
    groups = {"metrics": found.metrics}
    for grouping in GROUPINGS[task]:
        for key, scores in getattr(found, grouping).items():
            groups[f"{grouping}.{key}"] = scores
    for place, scores in groups.items():
        for name, score in scores.items():
            _check_score(f"{place}.{name}", name, score, found)
    for name, score in found.metrics.items():
        _check_agreement(found, name, score.value)
    return found


def _check_score(place: str, name: str, score: Score, file: ScoreFile) -> None:
    """Raise JsonError unless a score suits its name, its interval, and the number of items."""
    known, most = _metric(place, name, file.task), len(file.ids)
    if score.unit != known.unit:
        raise refusal(f"{place}.unit", repr(score.unit), repr(known.unit))
    if score.value > known.largest:
        raise refusal(f"{place}.value", shown(score.value), f"at most {known.largest:g}")
    if score.n > most:
        raise refusal(f"{place}.n", shown(score.n), f"at most {most}, the number of items")
    if (score.low is None) != (score.high is None):
        raise refusal(place, "one end of an interval", "both, or null for both")
    if score.low is not None and score.high is not None and score.low > score.high:
        found = f"low {score.low!r} and high {score.high!r}"
        raise refusal(place, found, "low to be at most high")
    if score.std is not None and file.runs == 1:
        raise refusal(f"{place}.std", shown(score.std), "null, as there is one run")


def _items(stored: Mapping[str, Any], task: str, runs: int) -> dict[str, NDArray[Any]]:
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
            most = _metric(place, name, task).largest
            columns[name] = _column(place, values, np.float64, 0, most)
    ids = columns[required[0]]
    for name, column in columns.items():
        if len(column) != len(ids):
            expected = f"{len(ids)}, as in {required[0]}"
            raise refusal(f"items.{name}", f"{len(column)} entries", expected)
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
            limits = f"from {least} to {most:g}" if np.isfinite(most) else f"from {least}"
            expected = f"a {'finite' if floats else 'whole'} number {limits}"
            raise refusal(f"{place}[{i}]", shown(value), expected)
    raise AssertionError("an array of numbers within limits can be made")


def _metric(place: str, name: str, task: str) -> Metric:
    """Return what a score is. Raises JsonError for a name that is no score of the task."""
    try:
        known = metric(name)
    except UnknownMetricError:
        known = None
    if known is None or known.task != task:
        raise refusal(place, f"no score of task {task!r}", "a name listed in docs/scores.md")
    return known


def _check_agreement(scores: ScoreFile, name: str, stored: float) -> None:
    """Raise JsonError unless a score is the mean of its column, over views and then scenes."""
    column = scores.items.get(name)
    if column is None or np.isnan(column).any():
        return
    index = np.unique(scores.clusters, return_inverse=True)[1]
    with np.errstate(over="ignore"):
        mean = float((np.bincount(index, column) / np.bincount(index)).mean())
    if abs(stored - mean) > AGREEMENT * max(abs(mean), abs(stored)):
        expected = f"{mean!r}, the mean of items.{name} over scenes"
        raise refusal(f"metrics.{name}.value", repr(stored), expected)
