"""The content of a score file, held against `records`, and whether its numbers agree.

What costs more than reading the file, the intervals, is left to `metrics.leaderboard.recheck`.
This module imports pydantic, so the commands import it only when they run.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from metrics.measures.skill import skill
from metrics.scoring.known_tests import known_test
from metrics.scoring.metric_names import SKILLED, metric
from metrics.scoring.records import (
    GROUPINGS,
    Score,
    ScoreFile,
    Skill,
    Task,
)
from metrics.scoring.tables import (
    check_presence,
    item_columns,
    known_metric,
    object_columns,
    within,
)
from metrics.submissions.problems import JsonError
from metrics.submissions.strict_json import refusal, shown, validated

AGREEMENT = 1e-9  # of numbers that are computed again, relative: other libraries add differently
RESAMPLES = range(100, 100_001)  # as many as `bench score` takes
TOTALS = {"rooms": ("rows", "rows_in_truth"), "iqtt": ("questions", "questions_in_truth")}
SCORE_AGAIN = "score the submission again with this release"
NOT_COMPARABLE = "not comparable"  # how a warning begins that tells why


@dataclass(frozen=True)
class Head:
    """The keys that say how to read the others."""

    format: Literal["pix2shape-bench/scores"]
    format_version: Annotated[str, Field(pattern=r"^3\.[0-9]{1,4}$")]
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
        if error.where == "format_version" and error.found.startswith(("'1.", "'2.")):
            raise JsonError(error.where, error.found, error.expected, SCORE_AGAIN) from error
        raise
    body = {key: value for key, value in content.items() if key not in ("format", "format_version")}
    foreign = {"path"}.union(*GROUPINGS.values()).difference(GROUPINGS[task])
    foreign |= {"objects"} if task == "iqtt" else set()
    for name in foreign.intersection(body):
        raise refusal(name, "an unknown key", "no key of this name")
    found = validated(ScoreFile, body)
    if task == "iqtt" and found.alignment != "none":
        raise refusal("alignment", repr(found.alignment), "'none'")
    if task == "iqtt" and "noise_floors" in body["meta"]:
        raise refusal("meta.noise_floors", "an unknown key", "no key of this name")
    if len({submission.sha256 for submission in found.meta.submissions}) < found.runs:
        raise refusal("meta.submissions", "the same sha256 twice", "each submission once")
    found = replace(found, items=item_columns(found.items, task, found.runs))
    found = replace(found, objects=object_columns(found))
    check_presence(found)
    for name in found.meta.noise_floors:
        known_metric(f"meta.noise_floors.{name:.60}", name, task)
    _check_counts(found)
    _check_comparable(found)
    most = len(np.unique(found.clusters))
    for place, scores in all_scores(found):
        if not scores:
            raise refusal(place, "no score", "at least one")
        for name, score in scores.items():
            _check_score(f"{place}.{name}", name, score, found, most)
    for name, score in found.metrics.items():
        _check_mean(found, name, score)
    for name, known in found.skills.items():
        _check_skill(found, name, known)
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
    if file.task == "iqtt" and counts.get("answers") not in (2, 3):
        raise _wrong_count(counts, "answers", "2 or 3, of each question")
    if file.task == "rooms":
        expected["scenes"] = len(np.unique(file.clusters))
    if file.objects:
        rows = file.objects["row"]
        expected["objects"] = len(rows)
        expected["rows_without_objects"] = len(ids) - len(np.unique(rows))
    for name, number in expected.items():
        if counts.get(name) != number:
            raise _wrong_count(counts, name, f"{number}, as in items and meta.submissions")
    if counts.get(all_there, 0) <= ids.max():
        raise _wrong_count(counts, all_there, f"more than {ids.max()}, the largest number in items")
    if file.task == "rooms" and counts.get("rows_penalised", len(ids) + 1) > len(ids):
        raise _wrong_count(counts, "rows_penalised", f"at most {len(ids)}")
    if file.objects and len(file.objects["row"]):
        shown_by = np.bincount(np.unique(rows, return_inverse=True)[1], file.objects["pixels"])
        if counts.get("pixels", 0) < shown_by.max():
            raise _wrong_count(counts, "pixels", f"at least {shown_by.max():.0f}, as in objects")
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
    known = known_test(file.meta.truth_digest)
    if file.meta.truth_source == "known" and (known is None or known.task != file.task):
        expected = "given, or submission, as this release does not know the digest"
        raise refusal("meta.truth_source", "'known'", expected)
    if known is not None and known.rows != all_there:
        place = f"meta.counts.{TOTALS[file.task][1]}"
        raise refusal(place, str(all_there), f"{known.rows}, as {known.name} has")
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
    known = known_metric(place, name, file.task)
    if score.unit != known.unit:
        raise refusal(f"{place}.unit", repr(score.unit), repr(known.unit))
    if not known.smallest <= score.value <= known.largest:
        expected = f"a number {within(known.smallest, known.largest)}"
        raise refusal(f"{place}.value", shown(score.value), expected)
    if score.n > most:
        what = "scenes" if file.task == "rooms" else "questions"
        raise refusal(f"{place}.n", shown(score.n), f"at most {most}, the number of {what}")
    _check_interval(place, score)
    if score.std is not None and file.runs == 1:
        raise refusal(f"{place}.std", shown(score.std), "null, as there is one run")


def _check_interval(place: str, score: Score | Skill) -> None:
    """Raise JsonError unless an interval has both ends or none, and the value between them."""
    if (score.low is None) != (score.high is None):
        raise refusal(place, "one end of an interval", "both, or null for both")
    if score.low is not None and score.high is not None:
        slack = AGREEMENT * abs(score.value)
        if not score.low - slack <= score.value <= score.high + slack:
            found = f"{score.value!r} outside of {score.low!r} to {score.high!r}"
            raise refusal(f"{place}.value", found, "a value within its interval")


def _mean(file: ScoreFile, name: str, why: str) -> tuple[float, int]:
    """Return the mean of a column, over views and then scenes, and the number of scenes."""
    column = file.items.get(name)
    if column is None:
        raise refusal(f"items.{name}", "no such key", f"the column of {why}")
    there = ~np.isnan(column)
    if not there.any() or not (there.all() or metric(name).lacking):
        raise refusal(f"items.{name}", "null", f"numbers, as {why} is their mean")
    index = np.unique(file.clusters[there], return_inverse=True)[1]
    with np.errstate(over="ignore"):  # `cluster_means` refuses columns whose sum overflows
        means = np.bincount(index, column[there]) / np.bincount(index)
        return float(means.mean()), len(means)


def _check_mean(file: ScoreFile, name: str, score: Score) -> None:
    """Raise JsonError unless a score is the mean of its column, over views and then scenes."""
    mean, clusters = _mean(file, name, f"metrics.{name}")
    if score.n != clusters:
        raise refusal(f"metrics.{name}.n", shown(score.n), f"{clusters}, as in items")
    if not agree(score.value, mean, 0.0):
        expected = f"{mean!r}, the mean of items.{name} over scenes"
        raise refusal(f"metrics.{name}.value", repr(score.value), expected)


def _check_skill(file: ScoreFile, name: str, found: Skill) -> None:
    """Raise JsonError unless a skill follows from a score of the file and from its floor."""
    place = f"skills.{name}"
    known = known_metric(f"skills.{name:.60}", name, file.task)
    if not known.smallest <= found.floor <= known.largest:
        expected = f"a number {within(known.smallest, known.largest)}"
        raise refusal(f"{place}.floor", shown(found.floor), expected)
    if name not in file.metrics:
        raise refusal(place, "the skill of no score", f"metrics.{name}")
    if file.task == "rooms":
        if name not in SKILLED:
            raise refusal(place, "a score without skill", f"one of {', '.join(SKILLED)}")
        column = SKILLED[name] + name
        if found.floor_name != column:
            raise refusal(f"{place}.floor_name", repr(found.floor_name), repr(column))
        mean, _ = _mean(file, column, f"{place}.floor")
        floor = max(mean, 0.0)
        # Where numbers of both signs cancel, all that is left of the mean may be rounding.
        if not agree(found.floor, floor, 1.0 if known.smallest < 0.0 else 0.0):
            told = "0.0, as below 0 is" if mean < 0.0 else f"{floor!r},"
            expected = f"{told} the mean of items.{column} over scenes"
            raise refusal(f"{place}.floor", repr(found.floor), expected)
    expected_value = skill(file.metrics[name].value, found.floor, known.higher_is_better)
    if expected_value is None or not agree(found.value, expected_value, 1.0):
        told = "no skill" if expected_value is None else repr(expected_value)
        raise refusal(f"{place}.value", repr(found.value), f"{told}, as score and floor say")
    _check_interval(place, found)
