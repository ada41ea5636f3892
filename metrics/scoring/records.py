"""The scores of one method on one test set, as records; `metrics.score_file` reads and writes.

`schema` reads them with pydantic, by the types and limits that are stated here; nothing is checked
where a record is made in memory.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

from numpy.typing import NDArray
from pydantic import ConfigDict, FailFast, Field, SkipValidation

from metrics.measures.depth import Alignment
from metrics.submissions.strict_json import LARGEST_WHOLE

FORMAT_NAME = "pix2shape-bench/scores"
FORMAT_VERSION = "3.0"
LONGEST_NAME = 200  # characters of method, run and fingerprint
LONGEST_TEXT = 10_000
Task = Literal["rooms", "iqtt"]
TruthSource = Literal["given", "known", "submission"]
Key = TypeVar("Key")
Value = TypeVar("Value")
Name = Annotated[str, Field(max_length=LONGEST_NAME)]
Text = Annotated[str, Field(max_length=LONGEST_TEXT)]
Whole = Annotated[int, Field(strict=True, ge=0, le=LARGEST_WHOLE)]
Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
NotNegative = Annotated[Number, Field(ge=0.0)]
# The first error is all that is told: no need to collect the others.
TupleOf = Annotated[tuple[Value, ...], FailFast()]
ByKey = Annotated[Mapping[Key, Value], FailFast()]
# Columns of `ScoreFile.items` that identify each entry; no two entries share the first one.
ID_COLUMNS = {"rooms": ("row", "scene_index", "view_index"), "iqtt": ("question",)}
OPTIONAL_COLUMNS = {"rooms": ("view_angle_degrees",), "iqtt": ("shape",)}
# Columns of `ScoreFile.objects`, beside its scores: whole numbers, and a text.
OBJECT_COLUMNS = ("row", "object", "pixels")
SHAPE_COLUMN = "shape"
GROUPINGS = {
    "rooms": ("by_view_angle", "by_object_shape", "by_object_size"),
    "iqtt": ("by_distractor", "by_rotation_angle", "by_position"),
}


# Unknown keys are refused; the columns of items are arrays, which pydantic does not look into.
_CONFIG = ConfigDict(extra="forbid", arbitrary_types_allowed=True)


@dataclass(frozen=True)
class Score:
    """A score with its interval.

    Attributes:
        value: mean over views within a scene, then over scenes; or over questions. Rows that have
            no such score, as they show no object, are left out.
        low, high: ends of the interval at `Meta.confidence`; None where there is none.
        n: scenes, or questions, that it rests on.
        std: standard deviation over training runs (n - 1 in the denominator); None for one run.
    """

    __pydantic_config__ = _CONFIG
    value: Number
    low: Number | None
    high: Number | None
    unit: Text
    n: Annotated[int, Field(strict=True, ge=1)]
    std: NotNegative | None


@dataclass(frozen=True)
class Skill:
    """A score between that of a method that sees nothing, the floor, and a perfect one.

    Attributes:
        value: 1 is perfect, 0 is the floor, below 0 is worse than it; see `measures.skill`.
        low, high: ends of the interval at `Meta.confidence`; None where there is none. That of
            rooms is paired: it resamples the scenes of score and floor together.
        floor: the floor's score on the same items, in the unit of the score; 0 where it is less.
        floor_name: what has that score, such as "empty_room".
    """

    __pydantic_config__ = _CONFIG
    value: Annotated[Number, Field(le=1.0)]
    low: Number | None
    high: Number | None
    floor: Number
    floor_name: Annotated[Name, Field(pattern=r"\S")]


@dataclass(frozen=True)
class Submission:
    """A file that was scored: one training run."""

    __pydantic_config__ = _CONFIG
    path: Text
    sha256: Annotated[str, Field(pattern="^[0-9a-f]{64}$")]
    run: Name


@dataclass(frozen=True)
class Meta:
    """Where scores come from.

    Attributes:
        truth_fingerprint: of the test set; never empty. Where the truth file has none (the released
            3D-IQTT), SHA-256 of its answers.
        truth_path: where the truth lay.
        truth_digest: SHA-256 of those values of the truth that scores depend on, as they were
            read (the attribute `truth_digest` of rooms and question files).
        truth_source: who chose the truth: "given" by the person who scored, "known" to the
            benchmark by its digest, or named by the "submission" alone, which is not comparable.
        submissions: one for each training run.
        writer: the program and its release.
        versions: releases of the libraries that computed the scores, by package.
        seed, resamples: of the bootstrap; 0 resamples where intervals come by formula.
        confidence: of all intervals.
        counts: such as the number of rows, scenes, runs.
        warnings: for a person, such as why the scores are not comparable.
        noise_floors: by name of the score, what two samples of the true surface score against each
            other at this resolution; none for scores whose floor is 0, and for questions.
    """

    __pydantic_config__ = _CONFIG
    truth_fingerprint: Annotated[Name, Field(pattern=r"\S")]
    truth_path: Text
    truth_digest: Annotated[str, Field(pattern="^[0-9a-f]{64}$")]
    truth_source: TruthSource
    submissions: Annotated[TupleOf[Submission], Field(min_length=1)]
    writer: Text
    versions: ByKey[str, Text]
    seed: Whole
    resamples: Whole
    confidence: Annotated[Number, Field(ge=0.5, le=0.999)]
    counts: ByKey[str, Whole]
    warnings: TupleOf[Text]
    noise_floors: ByKey[str, NotNegative] = field(default_factory=dict)


Scores = ByKey[str, Score]
Groups = ByKey[str, Scores]
Degrees = Annotated[str, Field(pattern="^[0-9]{1,3}$")]
DegreeRange = Annotated[str, Field(pattern="^[0-9]{1,3}-[0-9]{1,3}$")]
KindOfAnswers = Annotated[str, Field(pattern=r"^[^\s].{0,59}$")]
Position = Annotated[str, Field(pattern="^[0-2]$")]
Shape = Annotated[str, Field(pattern=r"^[^\s].{0,59}$")]
PercentRange = Annotated[str, Field(pattern="^[0-9]{1,3}-[0-9]{1,3}$")]


@dataclass(frozen=True, eq=False)
class ScoreFile:
    """All scores of one method on one test set.

    Attributes:
        method: its name; any text.
        comparable: whether all of the test set was scored, nothing penalised, and the truth not
            chosen by the submission.
        alignment: what the method says it cannot know; "none" for questions.
        metrics: by name, see `metric_names`.
        items: columns of equal length with an entry for each image or question: the integers of
            `ID_COLUMNS`, maybe those of `OPTIONAL_COLUMNS` (-1 where not known; `shape` numbers the
            shapes of references, by which intervals are clustered), and float64 by
            name of the metric, means over the runs; NaN where a row has no such score.
        skills: by name of the score, for some of `metrics`.
        objects: rooms only: columns of equal length with an entry for each object that is scored
            by itself: the integers of `OBJECT_COLUMNS` (row of the truth, id in the image, pixels
            that show it), the text `SHAPE_COLUMN`, and float64 by name of the metric.
        by_object_shape: scores of `objects` by shape or class, such as "sphere"; rooms only.
        by_object_size: the same by range of the share of the picture in percent, such as "1-2".
        by_view_angle: scores by whole degrees between a view and its scene's first one, such as
            "35"; rooms only.
        by_distractor: by kind of wrong answers; questions only, as are the next two.
        by_rotation_angle: by range of degrees, such as "30-60".
        by_position: by index of the right answer, "0" to "2".
        path: where it was read from; no part of the content.
    """

    __pydantic_config__ = _CONFIG
    task: Task
    method: Name
    comparable: Annotated[bool, Field(strict=True)]
    alignment: Alignment
    metrics: Annotated[Scores, Field(min_length=1)]
    items: Mapping[str, Annotated[NDArray[Any], SkipValidation]]
    meta: Meta
    skills: ByKey[str, Skill] = field(default_factory=dict)
    objects: Mapping[str, Annotated[NDArray[Any], SkipValidation]] = field(default_factory=dict)
    by_view_angle: ByKey[Degrees, Scores] = field(default_factory=dict)
    by_object_shape: ByKey[Shape, Scores] = field(default_factory=dict)
    by_object_size: ByKey[PercentRange, Scores] = field(default_factory=dict)
    by_distractor: ByKey[KindOfAnswers, Scores] = field(default_factory=dict)
    by_rotation_angle: ByKey[DegreeRange, Scores] = field(default_factory=dict)
    by_position: ByKey[Position, Scores] = field(default_factory=dict)
    path: Path | None = None

    @property
    def runs(self) -> int:
        """The number of training runs over which the scores are means."""
        return len(self.meta.submissions)

    @property
    def ids(self) -> NDArray[Any]:
        """The row of the truth, or the question, that each entry of the columns is about, (N,)."""
        return self.items[ID_COLUMNS[self.task][0]]

    @property
    def clusters(self) -> NDArray[Any]:
        """The scene of each image, whose errors are correlated; each question by itself, (N,)."""
        return self.items["scene_index" if self.task == "rooms" else "question"]

    @property
    def place(self) -> str:
        """The path, or the method where there is none, to begin an error with."""
        return str(self.path) if self.path is not None else self.method
