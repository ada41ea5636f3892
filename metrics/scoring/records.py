"""The scores of one method on one test set: the items, and the numbers that follow from them.

`metrics.score_file` reads and writes the items with the limits that are stated here; nothing is
checked where a record is made in memory. Means, intervals, skills and groups are computed when they
are first asked for.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict, FailFast, Field

from iqtt.floors import Floor
from metrics.measured.protocols import BY_NAME
from metrics.measures.alignment import Alignment
from metrics.scoring.estimates import (
    ACCURACY,
    CONFIDENCE,
    Bootstrap,
    Groups,
    Score,
    Scores,
    Skill,
    accuracy,
    estimates,
    floor_column,
    grouped_estimates,
    object_sizes,
    pooled_estimates,
    question_skill,
    skills,
)
from metrics.scoring.known_tests import Task, known_test
from metrics.scoring.metric_names import BEHIND, HEADLINE, OBJECT_SCORES, OF_TRUTH, metric, unit_in
from metrics.submissions.layout import Shown
from metrics.submissions.strict_json import LARGEST_WHOLE

__all__ = [
    "GROUPINGS",
    "AnswerGroup",
    "Groups",
    "Length",
    "Meta",
    "Score",
    "ScoreFile",
    "Scores",
    "Skill",
    "Submission",
    "Task",
]

LONGEST_NAME = 200  # characters of method, run and fingerprint
LONGEST_TEXT = 10_000
Length = Literal["scene unit", "metre"]
TruthSource = Literal["given", "known", "submission"]
Array = NDArray[Any]
Value = TypeVar("Value")
Name = Annotated[str, Field(max_length=LONGEST_NAME)]
Text = Annotated[str, Field(max_length=LONGEST_TEXT)]
Label = Annotated[str, Field(pattern=r"^[^\s].{0,59}$")]  # of a group, or a shape
Digest = Annotated[str, Field(pattern="^[0-9a-f]{64}$")]
Whole = Annotated[int, Field(strict=True, ge=0, le=LARGEST_WHOLE)]
Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
NotNegative = Annotated[Number, Field(ge=0.0)]
# The first error is all that is told: no need to collect the others.
TupleOf = Annotated[tuple[Value, ...], FailFast()]
ByKey = Annotated[Mapping[str, Value], FailFast()]
# Columns of items that identify each entry; the first one ascends.
ID_COLUMNS = {
    "rooms": ("row", "scene_index", "view_index"),
    "iqtt": ("question",),
    "measured": ("row", "group", "pixels"),
}
OPTIONAL_COLUMNS = {"rooms": ("view_angle_degrees",), "iqtt": ("shape",), "measured": ()}
# Columns of objects, beside their scores: whole numbers, and a text.
OBJECT_COLUMNS = ("row", "object", "pixels")
SHAPE_COLUMN = "shape"
COUNTS = {
    "rooms": ("rows_in_truth", "rows_penalised", "pixels"),
    "iqtt": ("questions_in_truth", "answers", "abstained"),
    "measured": ("rows_in_truth", "rows_penalised"),
}
GROUPINGS = {
    "rooms": ("by_view_angle", "by_object_shape", "by_object_size"),
    "iqtt": (
        *("by_distractor", "by_rotation_angle", "by_position"),
        *("by_answer", "by_outcome", "by_circle"),
    ),
    "measured": (),
}
_STRICT = ConfigDict(extra="forbid")


@dataclass(frozen=True)
class Submission:
    """A file that was scored: one training run."""

    __pydantic_config__ = _STRICT
    path: Text
    sha256: Digest
    run: Name


@dataclass(frozen=True)
class AnswerGroup:
    """How a group of questions was answered. Which questions it holds would help to guess answers.

    Attributes:
        n: how many questions there are.
        right: how many of them each training run answered rightly.
        low, high: ends of the interval of the accuracy; None where there is none.
    """

    __pydantic_config__ = _STRICT
    n: Annotated[Whole, Field(ge=1)]
    right: TupleOf[Whole]
    low: Number | None
    high: Number | None

    @property
    def score(self) -> Score:
        """The accuracy, with its interval."""
        runs = np.array(self.right) / self.n
        std = float(runs.std(ddof=1)) if len(runs) > 1 else None
        unit = metric(ACCURACY).unit
        return Score(float(runs.mean()), self.low, self.high, unit, self.n, std)


AnswerGroups = ByKey[Annotated[Mapping[Label, AnswerGroup], FailFast(), Field(min_length=1)]]


@dataclass(frozen=True)
class Meta:
    """Where scores come from.

    Attributes:
        truth_fingerprint: of the test set; never empty. Where the truth file has none (the released
            3D-IQTT), SHA-256 of its answers.
        truth_path: where the truth lay.
        truth_digest: SHA-256 of those values of the truth that scores depend on, as they were
            read (the attribute `truth_digest` of rooms and question files).
        truth_given: whether the person who scored chose the truth, and not the submission.
        submissions: one for each training run.
        writer: the program and its release.
        versions: releases of the libraries that computed the scores, by package.
        seed, resamples: of the bootstrap; 0 resamples where intervals come by formula.
        counts: how many there are of each of `COUNTS`: rows or questions of the truth, rows with
            values that had to be penalised, pixels of an image, answers to each question, and
            abstentions of all runs.
        question_floors: of the kinds of questions, where they are known.
    """

    __pydantic_config__ = _STRICT
    confidence: ClassVar[float] = CONFIDENCE
    truth_fingerprint: Annotated[Name, Field(pattern=r"\S")]
    truth_path: Text
    truth_digest: Digest
    truth_given: Annotated[bool, Field(strict=True)]
    submissions: Annotated[TupleOf[Submission], Field(min_length=1)]
    writer: Text
    versions: ByKey[Text]
    seed: Whole
    resamples: Whole
    counts: ByKey[Whole]
    question_floors: TupleOf[Floor] = ()

    @property
    def truth_source(self) -> TruthSource:
        """Who chose the truth: the person who scored, or the submission alone.

        A truth that the submission names is "known" where the benchmark knows its digest.
        """
        if self.truth_given:
            return "given"
        return "submission" if known_test(self.truth_digest) is None else "known"


@dataclass(frozen=True, eq=False)
class ScoreFile:
    """The items of one method on one test set, and all scores that follow from them.

    Attributes:
        method: its name; any text.
        alignment: what the method says it cannot know; "none" for questions.
        columns: an entry for each of N images or questions: the integers of `ID_COLUMNS`, (N,), of
            which the first ascend, maybe those of `OPTIONAL_COLUMNS` (`view_angle_degrees`, float,
            as `rooms.view_angles` returns it; `shape` numbers the shapes of references, by which
            intervals are clustered), and float64 by name of the metric, (R, N) for R runs, (N,) for
            scores of OF_TRUTH; NaN where a row has no such score.
        object_columns: rooms only: an entry for each of L objects that are scored by themselves:
            the integers of `OBJECT_COLUMNS`, (L,) (row of the truth, id in the image, pixels that
            show it), the texts of `SHAPE_COLUMN`, (L,), and float64 by name of the metric, (R, L).
        answer_groups: questions only: by grouping, then by group.
        path: where it was read from; no part of the content.
        shown: rooms: which image of a scene the method was shown.
        protocol: measured truth: by which of `metrics.measured.protocols` it was scored; else "".
        length: the unit of lengths, "metre" in closed rooms.
        older: whether it was read from a file of an older format, in which scores of CHANGED have
            other definitions.
        declared: the alignment that it was scored under, where `aligned` put it under another one.
    """

    task: Task
    method: str
    alignment: Alignment
    columns: Mapping[str, Array]
    meta: Meta
    object_columns: Mapping[str, Array] = field(default_factory=dict)
    answer_groups: AnswerGroups = field(default_factory=dict)
    path: Path | None = None
    shown: Shown = "scored_view"
    older: bool = False
    protocol: str = ""
    length: Length = "scene unit"
    declared: Alignment | None = None

    @property
    def kind(self) -> str:
        """The kind of the test set, by which its headline goes: one of `metric_names.KINDS`."""
        if "solid_iou" in self.columns:
            return "layers"
        return "interiors" if self.task == "rooms" and self.length == "metre" else self.task

    @property
    def runs(self) -> int:
        """The number of training runs over which the scores are means."""
        return len(self.meta.submissions)

    @property
    def ids(self) -> Array:
        """The row of the truth, or the question, that each entry of the columns is about, (N,)."""
        return self.columns[ID_COLUMNS[self.task][0]]

    @property
    def clusters(self) -> Array:
        """The scene or group of each image, whose errors are correlated; or each question, (N,)."""
        names = {"rooms": "scene_index", "measured": "group", "iqtt": "question"}
        return self.columns[names[self.task]]

    @property
    def grouped(self) -> bool:
        """Whether some items share a cluster: views of a scene, images of a drive."""
        return len(np.unique(self.clusters)) < len(self.ids)

    @property
    def unit(self) -> str:
        """What intervals resample, in the plural."""
        if self.task == "measured":
            return "groups" if self.grouped else "images"
        return (
            "scenes" if self.task == "rooms" else "shapes" if "shape" in self.items else "questions"
        )

    def unit_of(self, name: str) -> str:
        """Return the unit of a score."""
        return unit_in(name, self.length)

    @property
    def weights(self) -> Array | None:
        """The weight of each image in a mean over all, (N,); None for a mean of scenes."""
        if self.task != "measured":
            return None
        by_pixels = BY_NAME[self.protocol].mean == "pixels"
        return self.columns["pixels"] if by_pixels else np.ones(len(self.ids))

    @property
    def truth(self) -> tuple[Task, str]:
        """The test set: scores are of the same one where these are equal, and only there."""
        return self.task, self.meta.truth_digest

    @property
    def shown_of_several(self) -> Shown | None:
        """What the method was shown, where there are other views than the first; else None."""
        later = self.task == "rooms" and bool((self.columns["view_index"] > 0).any())
        return self.shown if later else None

    @property
    def headline(self) -> tuple[str, ...]:
        """The main scores that there are. What is behind is asked of who sees the first view."""
        names = [name for name in HEADLINE[self.kind] if name in self.metrics]
        return tuple(name for name in names if name != BEHIND or self.shown == "first_view")

    def floor_of(self, name: str) -> str | None:
        """Return what begins the name of the column of items that is a score's floor; or None."""
        column = floor_column(self.items, self.clusters, name, self.shown)
        return None if column is None else column[: -len(name)]

    @property
    def place(self) -> str:
        """The path, or the method where there is none, to begin an error with."""
        return str(self.path) if self.path is not None else self.method

    @property
    def warnings(self) -> tuple[str, ...]:
        """Why the scores are not comparable; empty where they are."""
        meta, texts = self.meta, []
        if meta.truth_source == "submission":
            texts.append(
                f"ground truth: {meta.truth_path}, content {meta.truth_digest[:12]}, as the"
                " predictions name it; scores are ranked only if this file is given with --truth"
            )
        count = meta.counts[COUNTS[self.task][0]]
        if len(self.ids) < count:
            items = "questions" if self.task == "iqtt" else "images"
            texts.append(f"only {len(self.ids)} of {count} {items} are predicted by all runs")
        if meta.counts.get("rows_penalised"):
            texts.append(f"{meta.counts['rows_penalised']} images have values that are not finite")
        return tuple(f"not comparable: {text}" for text in texts)

    @cached_property
    def comparable(self) -> bool:
        """Whether all of the truth was scored, nothing penalised, and the truth is no claim."""
        return not self.warnings

    @cached_property
    def items(self) -> Mapping[str, Array]:
        """The columns with means over the runs, (N,) each."""
        return _means(self.columns)

    @cached_property
    def objects(self) -> Mapping[str, Array]:
        """The columns of single objects with means over the runs, (L,) each."""
        return _means(self.object_columns)

    @cached_property
    def metrics(self) -> Scores:
        """The scores over all items, by name; see `metric_names`."""
        if self.task == "iqtt":
            shapes = self.items.get("shape", self.ids)
            return {ACCURACY: accuracy(self._runs_of_scores[ACCURACY], shapes, self._bootstrap)}
        if self.weights is not None:
            weights = self.weights
            return pooled_estimates(self._runs_of_scores, self.clusters, weights, self._bootstrap)
        found = estimates(self._runs_of_scores, self.clusters, self._bootstrap)
        return {name: replace(score, unit=self.unit_of(name)) for name, score in found.items()}

    @cached_property
    def skills(self) -> Mapping[str, Skill]:
        """The skills of some of the scores, by name."""
        if self.task != "iqtt":
            return skills(self.items, self.clusters, self._bootstrap, self.shown, self.weights)
        kinds = {
            kind: group.n for kind, group in self.answer_groups.get("by_distractor", {}).items()
        }
        skill = question_skill(self.metrics[ACCURACY], kinds, self.question_floors)
        return {} if skill is None else {ACCURACY: skill}

    @cached_property
    def question_floors(self) -> Mapping[str, Floor]:
        """The floors of the kinds of questions that have one, by kind."""
        return {floor.kind: floor for floor in self.meta.question_floors}

    @cached_property
    def by_view_angle(self) -> Groups:
        """Scores by whole degrees between a view and its scene's first one, such as "35".

        Views that are turned by as much to the left and to the right are in one group.
        """
        angle = self.columns.get("view_angle_degrees")
        if angle is None or len(np.unique(self.columns["view_index"])) < 2:
            return {}
        here = np.isfinite(angle)
        size = np.abs(angle[here]).astype(np.int64)
        scores = {name: runs[:, here] for name, runs in self._runs_of_scores.items()}
        return grouped_estimates(scores, size, self.clusters[here], self._bootstrap)

    @cached_property
    def by_object_shape(self) -> Groups:
        """Scores of single objects by shape or class, such as "sphere"."""
        return self._groups_of_objects(self.object_columns.get(SHAPE_COLUMN))

    @cached_property
    def by_object_size(self) -> Groups:
        """Scores of single objects by range of the share of the picture in percent: "1-2"."""
        if not self.object_columns:
            return {}
        sizes = object_sizes(self.object_columns["pixels"], self.meta.counts["pixels"])
        return self._groups_of_objects(sizes)

    @cached_property
    def by_distractor(self) -> Groups:
        """Scores by kind of wrong answers."""
        return self._groups_of_answers("by_distractor")

    @cached_property
    def by_rotation_angle(self) -> Groups:
        """Scores by range of degrees, such as "30-60"."""
        return self._groups_of_answers("by_rotation_angle")

    @cached_property
    def by_position(self) -> Groups:
        """Scores by index of the right answer, "0" to "2"."""
        return self._groups_of_answers("by_position")

    @cached_property
    def by_answer(self) -> Groups:
        """Scores by the answer that was given, "0" to "2", or "none": how a method leans."""
        return self._groups_of_answers("by_answer")

    @cached_property
    def by_outcome(self) -> Groups:
        """Scores by what became of a model's text: see `OUTCOMES` of `submissions.rules`."""
        return self._groups_of_answers("by_outcome")

    @cached_property
    def by_circle(self) -> Groups:
        """Circular accuracy, as "every order": right in each order of the answers."""
        return self._groups_of_answers("by_circle")

    @cached_property
    def unread(self) -> float | None:
        """The share of a model's replies in which no letter was read; None where none was asked."""
        if "by_outcome" not in self.answer_groups:
            return None
        none = self.answer_groups["by_answer"].get("none")
        return (none.n if none else 0) / len(self.ids)

    @property
    def _bootstrap(self) -> Bootstrap:
        return Bootstrap(self.meta.seed, self.meta.resamples)

    @property
    def _runs_of_scores(self) -> dict[str, Array]:
        """The scores of the method, (R, N) each."""
        others = (*ID_COLUMNS[self.task], *OPTIONAL_COLUMNS[self.task])
        return {
            name: np.atleast_2d(column)
            for name, column in self.columns.items()
            if name not in others and not name.startswith(OF_TRUTH)
        }

    def _groups_of_objects(self, labels: Array | None) -> Groups:
        if labels is None:
            return {}
        entry = np.searchsorted(self.ids, self.object_columns["row"])
        scores = {name: np.atleast_2d(self.object_columns[name]) for name in OBJECT_SCORES}
        return grouped_estimates(scores, labels, self.clusters[entry], self._bootstrap)

    def _groups_of_answers(self, grouping: str) -> Groups:
        groups = self.answer_groups.get(grouping, {})
        return {key: {ACCURACY: group.score} for key, group in groups.items()}


def _means(columns: Mapping[str, Array]) -> dict[str, Array]:
    """Return columns of which those with runs, (R, N), are averaged over these."""
    return {
        name: column.mean(axis=0) if column.ndim == 2 else column
        for name, column in columns.items()
    }
