"""All figures of a report on people's answers. Only finished participants and real questions count.

Accuracy is a fraction of right answers, times are seconds, angles are degrees between the views of
the reference and of the right answer.
"""

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from iqtt.floors import Floor
from iqtt.quiz.answers import Answer, Answers
from metrics.scoring.questions import ANGLE_BINS
from metrics.submissions.reader import QuestionPredictions, open_predictions
from metrics.views.people.intervals import (
    Estimate,
    Line,
    crossed_estimate,
    line_within_people,
    mean_estimate,
    mean_of_people,
    within,
)
from metrics.views.people.references import Reference, references
from scenegen.common.errors import FileFormatError, SpecError

Array = NDArray[Any]
SHAPIRO_LEAST = 3  # participants


@dataclass(frozen=True)
class Group:
    """The answers to questions of one kind, or of a range of angles.

    Attributes:
        accuracy: mean of participants' accuracies.
        floor: of methods without 3D, where it is known.
        seconds: mean of participants' mean response times of right answers; None without times.
        line: of these times over the angle.
    """

    name: str
    answers: int
    accuracy: Estimate
    floor: float | None
    seconds: Estimate | None
    line: Line | None


@dataclass(frozen=True)
class Test:
    """A t-test of participants' accuracies: whether their mean could be that of `against`.

    Attributes:
        against: the name of the other.
        other: its accuracy.
        difference: of the means, people less the other.
        t, degrees, p: Student's statistic, degrees of freedom, and two-sided p; None where no two
            participants differ.
    """

    against: str
    other: float
    difference: Estimate
    t: float | None
    degrees: int
    p: float | None


@dataclass(frozen=True)
class Figures:
    """What a report tells.

    Attributes:
        begun, finished: numbers of participants.
        questions: how many each was asked; `distinct` is how many different ones were asked.
        scores: right answers of each finished participant, in the file's order.
        accuracy: with participants as the sample.
        crossed: the same mean, with participants and questions as samples.
        deviation: standard deviation of participants' accuracies; None for one.
        histogram: how many participants had 0, 1, ... right answers.
        shapiro: W and p of the Shapiro-Wilk test; None where it cannot be made.
        tests: against chance, and against a model.
        by_kind, by_angle: groups of answers.
        line: response times of right answers over the angle.
        timed: how many answers have a time that can be used.
    """

    begun: int
    finished: int
    questions: int
    distinct: int
    candidates: int
    scores: Sequence[int]
    accuracy: Estimate
    crossed: Estimate
    deviation: float | None
    histogram: Sequence[int]
    shapiro: tuple[float, float] | None
    tests: Sequence[Test]
    by_kind: Sequence[Group]
    by_angle: Sequence[Group]
    line: Line | None
    timed: int
    references: Sequence[Reference]


def counted(answers_file: Answers) -> list[Answer]:
    """Return the answers that count: of participants who finished, without the calibration.

    Raises FileFormatError where there are none.
    """
    answers = [a for a in answers_file.answers if a.finished and not a.calibration]
    if not answers:
        found = f"{answers_file.participants} participants, of whom none finished"
        raise FileFormatError(answers_file.path, found, "at least one who did")
    return answers


def compute(
    answers_file: Answers,
    model: str | Path | None = None,
    floors: Mapping[str, Floor] = MappingProxyType({}),
) -> Figures:
    """Return all figures.

    Args:
        model: a submission for the same split.
        floors: of the kinds of questions, as `iqtt.floors.floors_of` returns them.

    Raises FileFormatError where nobody finished, and as `open_predictions`; SpecError where the
    submission is for another split or lacks a question.
    """
    answers, settings = counted(answers_file), answers_file.settings
    numbers = {name: i for i, name in enumerate(dict.fromkeys(a.participant for a in answers))}
    people = np.array([numbers[answer.participant] for answer in answers])
    right = np.array([answer.correct for answer in answers], np.float64)
    angles = np.array([answer.angle_degrees for answer in answers], np.float64)  # NaN for None
    seconds = np.array([_usable_seconds(answer) for answer in answers])
    kinds = np.array([answer.kind for answer in answers])
    is_timed = (right == 1.0) & np.isfinite(seconds)

    def line(chosen: Array) -> Line | None:
        """Shepard and Metzler's line: the times of right answers over the angle."""
        used = chosen & is_timed & np.isfinite(angles)
        return line_within_people(angles[used], seconds[used], people[used])

    def group(name: str, chosen: Array, is_kind: bool) -> Group:
        timed = chosen & is_timed
        return Group(
            name=name,
            answers=int(chosen.sum()),
            accuracy=within(mean_of_people(right[chosen], people[chosen])),
            floor=floors[name].accuracy if is_kind and name in floors else None,
            seconds=mean_of_people(seconds[timed], people[timed]) if timed.any() else None,
            line=line(chosen) if is_kind else None,
        )

    scores = np.bincount(people, right).astype(int)
    shares = scores / settings.questions
    tests = [_test("chance", 1 / settings.answers, shares - 1 / settings.answers)]
    if model is not None:
        tests.append(_model_test(answers_file, answers, people, right, model))
    span = np.clip(np.digitize(angles, ANGLE_BINS) - 1, 0, len(ANGLE_BINS) - 2)
    span = np.where(np.isfinite(angles), span, -1)
    spans = [f"{a}-{b}" for a, b in itertools.pairwise(ANGLE_BINS)]
    return Figures(
        begun=answers_file.participants,
        finished=len(scores),
        questions=settings.questions,
        distinct=len({answer.question for answer in answers}),
        candidates=settings.answers,
        scores=scores.tolist(),
        accuracy=within(mean_estimate(shares)),
        crossed=crossed_estimate(right, people, [answer.question for answer in answers]),
        deviation=float(shares.std(ddof=1)) if len(shares) > 1 else None,
        histogram=np.bincount(scores, minlength=settings.questions + 1).tolist(),
        shapiro=_shapiro(shares),
        tests=tests,
        by_kind=[group(kind, kinds == kind, True) for kind in sorted(set(kinds.tolist()))],
        by_angle=[group(spans[i], span == i, False) for i in np.unique(span[span >= 0])],
        line=line(np.ones(len(answers), bool)),
        timed=int(np.isfinite(seconds).sum()),
        references=references(kinds.tolist(), settings.answers, floors),
    )


def _usable_seconds(answer: Answer) -> float:
    """Return an answer's time if it is from one uninterrupted look at the question, else NaN."""
    if answer.response_seconds is None or answer.times_shown != 1:
        return math.nan
    return answer.response_seconds


def _shapiro(shares: Array) -> tuple[float, float] | None:
    if len(shares) < SHAPIRO_LEAST or np.ptp(shares) == 0:
        return None
    result = stats.shapiro(shares)
    return float(result.statistic), float(result.pvalue)


def _test(against: str, other: float, differences: Array) -> Test:
    """Return the t-test of whether the mean of one difference per participant is 0."""
    degrees, difference = len(differences) - 1, mean_estimate(differences)
    if degrees < 1 or np.ptp(differences) <= 1e-12:
        return Test(against, other, difference, None, degrees, None)
    result = stats.ttest_1samp(differences, 0.0)
    t, p = float(result.statistic), float(result.pvalue)
    return Test(against, other, difference, t, degrees, p)


def _model_test(
    answers_file: Answers, answers: Sequence[Answer], people: Array, right: Array, model: str | Path
) -> Test:
    """Return the test against a model on the same questions, participant by participant."""
    with open_predictions(model) as predictions:
        if not isinstance(predictions, QuestionPredictions):
            raise SpecError(model, "predictions of rooms", "answers to questions")
        theirs, ours = predictions.truth_fingerprint, answers_file.settings.fingerprint
        if theirs and theirs != ours:
            found = f"answers to the split of fingerprint {theirs:.12}"
            raise SpecError(model, found, f"{ours:.12}, that of {answers_file.path}")
        answer_of = dict(zip(predictions.rows.tolist(), predictions.answers.tolist(), strict=True))
        name = predictions.method
    missing = {answer.question for answer in answers} - answer_of.keys()
    if missing:
        raise SpecError(
            model, f"no answer to {len(missing)} questions that people were asked, such as"
            f" {min(missing)}", "an answer to each"
        )  # fmt: skip
    good = np.array([answer_of[a.question] == a.right_answer for a in answers], np.float64)
    differences = np.bincount(people, right - good) / np.bincount(people)
    return _test(name, float(good.mean()), differences)
