"""The content of a score file: the type and limits of every key, and that the numbers agree.

This module imports pydantic: import it only where a score file is really read or written.
"""

import sys
from collections.abc import Mapping
from typing import Annotated, Any, Literal, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, FailFast, Field

from metrics.scoring.metric_names import Metric, UnknownMetricError, metric
from metrics.scoring.records import (
    GROUPINGS,
    ID_COLUMNS,
    LONGEST_NAME,
    LONGEST_TEXT,
    OPTIONAL_COLUMNS,
    Meta,
    Score,
    ScoreFile,
    Submission,
    Task,
)
from metrics.submissions.strict_json import LARGEST_WHOLE, Record, refusal, shown, validated

AGREEMENT = 1e-9  # of a score with the mean of its column, relative
Value = TypeVar("Value")
Name = Annotated[str, Field(max_length=LONGEST_NAME)]
Text = Annotated[str, Field(max_length=LONGEST_TEXT)]
Whole = Annotated[int, Field(ge=0, le=LARGEST_WHOLE)]
NotNegative = Annotated[float, Field(ge=0.0)]
# The first error is all that is told: no need to collect the others.
ListOf = Annotated[list[Value], FailFast()]
ByName = Annotated[dict[str, Value], FailFast()]


class ScoreRecord(Record):
    """A score, as in `records.Score`."""

    value: NotNegative
    low: float | None
    high: float | None
    unit: Text
    n: Annotated[int, Field(ge=1)]
    std: NotNegative | None


class SubmissionRecord(Record):
    """A file that was scored."""

    path: Text
    sha256: Annotated[str, Field(pattern="^[0-9a-f]{64}$")]
    run: Name


class MetaRecord(Record):
    """Where the scores come from."""

    truth_fingerprint: Annotated[Name, Field(pattern=r"\S")]
    truth_path: Text
    submissions: Annotated[ListOf[SubmissionRecord], Field(min_length=1)]
    writer: Text
    versions: ByName[Text]
    seed: Annotated[int, Field(ge=-LARGEST_WHOLE, le=LARGEST_WHOLE)]
    resamples: Whole
    confidence: Annotated[float, Field(gt=0.0, lt=1.0)]
    counts: ByName[Whole]
    warnings: ListOf[Text]


class RoomsMetaRecord(MetaRecord):
    """Where the scores of rooms come from."""

    chamfer_floor: NotNegative | None = None


Scores = ByName[ScoreRecord]


GroupName = TypeVar("GroupName")
ScoresBy = Annotated[dict[GroupName, Scores], FailFast()]
Degrees = Annotated[str, Field(pattern="^[0-9]{1,3}$")]
DegreeRange = Annotated[str, Field(pattern="^[0-9]{1,3}-[0-9]{1,3}$")]
KindOfAnswers = Annotated[str, Field(pattern=r"^[^\s].{0,59}$")]
Position = Annotated[str, Field(pattern="^[0-2]$")]


class Head(BaseModel):
    """The keys that say how to read the others."""

    model_config = ConfigDict(strict=True)
    format: Literal["pix2shape-bench/scores"]
    format_version: Annotated[str, Field(pattern=r"^1\.[0-9]{1,4}$")]
    task: Task


class FileRecord(Record, Head):
    """A score file of either task; `items` are checked by `_column`."""

    method: Name
    comparable: bool
    metrics: Annotated[Scores, Field(min_length=1)]
    items: dict[str, Any]
    meta: MetaRecord


class RoomsRecord(FileRecord):
    """A score file of rooms."""

    alignment: Literal["none", "median_scale", "scale", "scale_shift"]
    meta: RoomsMetaRecord
    by_view_angle: ScoresBy[Degrees] = Field(default_factory=dict)


class QuestionsRecord(FileRecord):
    """A score file of questions."""

    alignment: Literal["none"]
    by_distractor: ScoresBy[KindOfAnswers] = Field(default_factory=dict)
    by_rotation_angle: ScoresBy[DegreeRange] = Field(default_factory=dict)
    by_position: ScoresBy[Position] = Field(default_factory=dict)


RECORDS: dict[str, type[RoomsRecord] | type[QuestionsRecord]] = {
    "rooms": RoomsRecord,
    "iqtt": QuestionsRecord,
}


def parse_scores(content: Any) -> ScoreFile:
    """Check the parsed JSON of a score file. Raises JsonError at the first thing that is wrong."""
    task = validated(Head, content).task
    found = validated(RECORDS[task], content)
    runs = len(found.meta.submissions)
    digests = [submission.sha256 for submission in found.meta.submissions]
    if len(set(digests)) < runs:
        raise refusal("meta.submissions", "the same sha256 twice", "each submission once")
    items = _items(found.items, task, runs)
    most = len(items[ID_COLUMNS[task][0]])

    def scores(place: str, stored: Mapping[str, ScoreRecord]) -> dict[str, Score]:
        for name, one in stored.items():
            _check_score(f"{place}.{name}", name, one, task, runs, most)
        return {name: Score(**dict(one)) for name, one in stored.items()}

    meta = dict(found.meta) | {
        "submissions": tuple(Submission(**dict(one)) for one in found.meta.submissions),
        "warnings": tuple(found.meta.warnings),
    }
    groups: dict[str, Any] = {
        name: {key: scores(f"{name}.{key}", some) for key, some in getattr(found, name).items()}
        for name in GROUPINGS[task]
    }
    parsed = ScoreFile(
        task,
        found.method,
        found.comparable,
        found.alignment,
        scores("metrics", found.metrics),
        items,
        Meta(**meta),
        **groups,
    )
    for name, stored in parsed.metrics.items():
        _check_agreement(parsed, name, stored.value)
    return parsed


def _check_score(
    place: str, name: str, score: ScoreRecord, task: str, runs: int, most: int
) -> None:
    """Raise JsonError unless a score suits its name, its interval, and the number of items."""
    known = _metric(place, name, task)
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
    if score.std is not None and runs == 1:
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
