"""The content of a score file, held against `records`, and whether its numbers agree.

What costs more than reading the file, the intervals, is left to `metrics.leaderboard.recheck`.
This module imports pydantic, so the commands import it only when they run.
"""

import math
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from metrics.measures.statistics import cluster_means
from metrics.scoring.metric_names import Metric, UnknownMetricError, metric
from metrics.scoring.records import GROUPINGS, ID_COLUMNS, OPTIONAL_COLUMNS, Score, ScoreFile, Task
from metrics.submissions.problems import JsonError
from metrics.submissions.strict_json import LARGEST_WHOLE, refusal, shown, validated

AGREEMENT = 1e-9  # of numbers that are computed again, relative: other libraries add differently
RESAMPLES = range(100, 100_001)  # as many as `bench score` takes
TOTALS = {"rooms": ("rows", "rows_in_truth"), "iqtt": ("questions", "questions_in_truth")}
SCORE_AGAIN = "score the submission again with this release"
NOT_COMPARABLE = "not comparable"  # how a warning begins that tells why


@dataclass(frozen=True)
class Head:
    """The keys that say how to read the others."""

    format: Literal["pix2shape-bench/scores"]
    format_version: Annotated[str, Field(pattern=r"^2\.[0-9]{1,4}$")]
    task: Task


def agree(found: float | None, expected: float | None, scale: float) -> bool:
    """Return whether two numbers differ by rounding only, that of sums of this scale included."""
    if found is None or expected is None:
        return found is expected
    near = AGREEMENT * max(abs(found), abs(expected), abs(scale))
    return math.isfinite(near) and abs(found - expected) <= near


def parse_scores(content: Any) -> ScoreFile:
    """Check the parsed JSON of a score file. Raises JsonError at the first thing that is wrong."""
    try:
        task = validated(Head, content).task
    except JsonError as error:
        if error.where == "format_version" and error.found.startswith("'1."):
            raise JsonError(error.where, error.found, error.expected, SCORE_AGAIN) from error
        raise
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
    _check_counts(found)
    _check_comparable(found)
    most = len(np.unique(found.clusters))
    for place, scores in all_scores(found):
        for name, score in scores.items():
            _check_score(f"{place}.{name}", name, score, found, most)
    for name, score in found.metrics.items():
        _check_mean(found, name, score, most)
    return found


def all_scores(file: ScoreFile) -> Iterator[tuple[str, Mapping[str, Score]]]:
    """Yield the scores of all items, then those of each group, with their place in the file."""
    yield "metrics", file.metrics
    for grouping in GROUPINGS[file.task]:
        for key, scores in getattr(file, grouping).items():
            yield f"{grouping}.{key}", scores


def _check_counts(file: ScoreFile) -> None:
    """Raise JsonError unless what is counted is what is there, and the bootstrap is one of ours."""
    scored, all_there = TOTALS[file.task]
    counts, ids = file.meta.counts, file.ids
    expected = {scored: len(ids), "runs": file.runs}
    if file.task == "rooms":
        expected["scenes"] = len(np.unique(file.clusters))
    for name, number in expected.items():
        if counts.get(name) != number:
            raise _wrong_count(counts, name, f"{number}, as in items and meta.submissions")
    if counts.get(all_there, 0) <= ids.max():
        raise _wrong_count(counts, all_there, f"more than {ids.max()}, the largest number in items")
    if file.task == "rooms" and counts.get("rows_penalised", len(ids) + 1) > len(ids):
        raise _wrong_count(counts, "rows_penalised", f"at most {len(ids)}")
    formula = file.task == "iqtt" and file.runs == 1
    if file.meta.resamples not in ((0,) if formula else RESAMPLES):
        expected_number = "0, as the interval is Wilson's" if formula else "100 to 100000"
        raise refusal("meta.resamples", shown(file.meta.resamples), expected_number)


def _wrong_count(counts: Mapping[str, int], name: str, expected: str) -> JsonError:
    found = shown(counts[name]) if name in counts else "no such key"
    return refusal(f"meta.counts.{name}", found, expected)


def _check_comparable(file: ScoreFile) -> None:
    """Raise JsonError where scores claim to be comparable, and the file says why they are not."""
    scored, all_there = (file.meta.counts[name] for name in TOTALS[file.task])
    reasons = {
        "only the submission named its truth": file.meta.truth_source == "submission",
        f"{scored} of {all_there} are scored": scored < all_there,
        "rows are penalised": file.meta.counts.get("rows_penalised", 0) > 0,
        "meta.warnings tells why": any(w.startswith(NOT_COMPARABLE) for w in file.meta.warnings),
    }
    for reason, holds in reasons.items():
        if file.comparable and holds:
            raise refusal("comparable", "true", f"false, as {reason}")


def _check_score(place: str, name: str, score: Score, file: ScoreFile, most: int) -> None:
    """Raise JsonError unless a score suits its name, its interval, and the number of clusters."""
    known = _metric(place, name, file.task)
    if score.unit != known.unit:
        raise refusal(f"{place}.unit", repr(score.unit), repr(known.unit))
    if score.value > known.largest:
        raise refusal(f"{place}.value", shown(score.value), f"at most {known.largest:g}")
    if score.n > most:
        what = "scenes" if file.task == "rooms" else "questions"
        raise refusal(f"{place}.n", shown(score.n), f"at most {most}, the number of {what}")
    if (score.low is None) != (score.high is None):
        raise refusal(place, "one end of an interval", "both, or null for both")
    if score.low is not None and score.high is not None:
        slack = AGREEMENT * score.value
        if not score.low - slack <= score.value <= score.high + slack:
            found = f"{score.value!r} outside of {score.low!r} to {score.high!r}"
            raise refusal(f"{place}.value", found, "a value within its interval")
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


def _check_mean(file: ScoreFile, name: str, score: Score, clusters: int) -> None:
    """Raise JsonError unless a score is the mean of its column, over views and then scenes."""
    if score.n != clusters:
        raise refusal(f"metrics.{name}.n", shown(score.n), f"{clusters}, as in items")
    column = file.items.get(name)
    if column is None:
        raise refusal(f"items.{name}", "no such key", f"the column of metrics.{name}")
    if np.isnan(column).any():
        raise refusal(f"items.{name}", "null", f"numbers, as metrics.{name} is their mean")
    with np.errstate(over="ignore"):
        mean = float(cluster_means(column, file.clusters).mean())
    if not agree(score.value, mean, 0.0):
        expected = f"{mean!r}, the mean of items.{name} over scenes"
        raise refusal(f"metrics.{name}.value", repr(score.value), expected)
