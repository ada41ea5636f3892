"""All figures of a report on people's answers. Only finished participants and real questions count.

Accuracy is a fraction of right answers, times are seconds, angles are degrees between the views of
the reference and of the right answer.
"""

import itertools
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from iqtt.quiz.answers import Answer, Answers
from metrics.people.intervals import (
    Estimate,
    Line,
    crossed_estimate,
    line_within_people,
    mean_estimate,
    mean_of_people,
    within,
)
from metrics.people.references import Reference, references
from metrics.scoring.floors import floor_of_kind
from metrics.scoring.questions import ANGLE_BINS
from metrics.submissions.reader import QuestionPredictions, open_predictions
from scenegen.common.errors import FileFormatError, SpecError

Array = NDArray[Any]
SHAPIRO_LEAST = 3  # participants


@dataclass(frozen=True)
class Group:
    """The answers to questions of one kind, or of a range of angles.

    Attributes:
        accuracy: mean of participants' accuracies.
        floor: of outlines, where it is known.
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


def counted(found: Answers) -> list[Answer]:
    """Return the answers that count: of participants who finished, without the calibration.

    Raises FileFormatError where there are none.
    """
    answers = [one for one in found.answers if one.finished and not one.calibration]
    if not answers:
        what = f"{found.participants} participants, of whom none finished"
        raise FileFormatError(found.path, what, "at least one who did")
    return answers


def compute(found: Answers, model: str | Path | None = None) -> Figures:
    """Return all figures; `model` is a submission for the same split.

    Raises FileFormatError where nobody finished, and as `open_predictions`; SpecError where the
    submission is for another split or lacks a question.
    """
    answers = counted(found)
    people = np.unique([one.participant for one in answers], return_inverse=True)[1]
    order = np.unique(people, return_index=True)[1]
    right = np.array([one.correct for one in answers], np.float64)
    asked = found.settings.questions
    scores = np.bincount(people, right)[people[np.sort(order)]].astype(int)
    shares = scores / asked
    chance = 1 / found.settings.answers
    tests = [_test("chance", chance, shares - chance)]
    if model is not None:
        tests.append(_model_test(found, answers, people, right, model))
    usable = [i for i, one in enumerate(answers) if _timed(one)]

    def groups(names: Sequence[str | None], order: Sequence[str], floors: bool) -> list[Group]:
        return [
            _group(name, [i for i, n in enumerate(names) if n == name], answers, people,
                   found.settings.answers if floors else None)
            for name in order if name in names
        ]  # fmt: skip

    kinds = [one.kind for one in answers]
    spans = [f"{a}-{b}" for a, b in itertools.pairwise(ANGLE_BINS)]
    return Figures(
        begun=found.participants,
        finished=len(scores),
        questions=asked,
        distinct=len({one.question for one in answers}),
        candidates=found.settings.answers,
        scores=scores.tolist(),
        accuracy=within(mean_estimate(shares)),
        crossed=crossed_estimate(right, people, [one.question for one in answers]),
        deviation=float(shares.std(ddof=1)) if len(shares) > 1 else None,
        histogram=np.bincount(scores, minlength=asked + 1).tolist(),
        shapiro=_shapiro(shares),
        tests=tests,
        by_kind=groups(kinds, sorted(set(kinds)), floors=True),
        by_angle=groups([_span(one, spans) for one in answers], spans, floors=False),
        line=_line(answers, people, range(len(answers))),
        timed=len(usable),
        references=references(kinds, found.settings.answers),
    )


def _timed(one: Answer) -> bool:
    """Return whether an answer's time is known and from one uninterrupted look at the question."""
    return one.response_seconds is not None and one.times_shown == 1


def _span(one: Answer, spans: Sequence[str]) -> str | None:
    if one.angle_degrees is None:
        return None
    place = int(np.digitize(one.angle_degrees, ANGLE_BINS)) - 1
    return spans[min(max(place, 0), len(spans) - 1)]


def _group(
    name: str, chosen: Sequence[int], answers: Sequence[Answer], people: Array, offered: int | None
) -> Group:
    """Return the figures of the chosen answers; with `offered`, name is a kind that has a floor."""
    right = [answers[i].correct for i in chosen]
    timed = [i for i in chosen if _timed(answers[i]) and answers[i].correct]
    seconds = [answers[i].response_seconds or 0.0 for i in timed]
    return Group(
        name=name,
        answers=len(chosen),
        accuracy=within(mean_of_people(right, people[list(chosen)])),
        floor=floor_of_kind(name, offered)[0] if offered else None,
        seconds=mean_of_people(seconds, people[timed]) if timed else None,
        line=_line(answers, people, chosen) if offered else None,
    )


def _line(answers: Sequence[Answer], people: Array, chosen: Sequence[int]) -> Line | None:
    """Return Shepard and Metzler's line: the times of right answers over the angle."""
    used = [
        i
        for i in chosen
        if answers[i].correct and _timed(answers[i]) and answers[i].angle_degrees is not None
    ]
    angles = [answers[i].angle_degrees or 0.0 for i in used]
    seconds = [answers[i].response_seconds or 0.0 for i in used]
    return line_within_people(angles, seconds, people[used])


def _shapiro(shares: Array) -> tuple[float, float] | None:
    if len(shares) < SHAPIRO_LEAST or np.ptp(shares) == 0:
        return None
    found = stats.shapiro(shares)
    return float(found.statistic), float(found.pvalue)


def _test(against: str, other: float, differences: Array) -> Test:
    """Return the t-test of whether the mean of one difference per participant is 0."""
    degrees, difference = len(differences) - 1, mean_estimate(differences)
    if degrees < 1 or np.ptp(differences) <= 1e-12:
        return Test(against, other, difference, None, degrees, None)
    found = stats.ttest_1samp(differences, 0.0)
    return Test(against, other, difference, float(found.statistic), degrees, float(found.pvalue))


def _model_test(
    found: Answers, answers: Sequence[Answer], people: Array, right: Array, model: str | Path
) -> Test:
    """Return the test against a model on the same questions, participant by participant."""
    with open_predictions(model) as predictions:
        if not isinstance(predictions, QuestionPredictions):
            raise SpecError(model, "predictions of rooms", "answers to questions")
        told, own = predictions.truth_fingerprint, found.settings.fingerprint
        if told and told != own:
            what = f"answers to the split of fingerprint {told:.12}"
            raise SpecError(model, what, f"{own:.12}, that of {found.path}")
        given = dict(zip(predictions.rows.tolist(), predictions.answers.tolist(), strict=True))
        name = predictions.method
    missing = Counter(one.question for one in answers if one.question not in given)
    if missing:
        raise SpecError(
            model, f"no answer to {len(missing)} questions that people were asked, such as"
            f" {min(missing)}", "an answer to each"
        )  # fmt: skip
    good = np.array([given[one.question] == one.right_answer for one in answers], np.float64)
    differences = np.bincount(people, right - good) / np.bincount(people)
    return _test(name, float(good.mean()), differences)
