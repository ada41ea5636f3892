"""All figures of a report on people's answers. Only finished participants and real questions count.

Accuracy is a fraction of right answers, times are seconds, angles are degrees between the views of
the reference and of the right answer.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from iqtt.quiz.answers import Answer, Answers
from metrics.scoring.floors import floor_of_kind
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


def counted(answers_file: Answers) -> list[Answer]:
    """Return the answers that count: of participants who finished, without the calibration.

    Raises FileFormatError where there are none.
    """
    answers = [a for a in answers_file.answers if a.finished and not a.calibration]
    if not answers:
        found = f"{answers_file.participants} participants, of whom none finished"
        raise FileFormatError(answers_file.path, found, "at least one who did")
    return answers


def compute(answers_file: Answers, model: str | Path | None = None) -> Figures:
    """Return all figures; `model` is a submission for the same split.

    Raises FileFormatError where nobody finished, and as `open_predictions`; SpecError where the
    submission is for another split or lacks a question.
    """
    answers = counted(answers_file)
    people = np.unique([answer.participant for answer in answers], return_inverse=True)[1]
    order = np.unique(people, return_index=True)[1]
    right = np.array([answer.correct for answer in answers], np.float64)
    questions, offered = answers_file.settings.questions, answers_file.settings.answers
    scores = np.bincount(people, right)[people[np.sort(order)]].astype(int)
    shares = scores / questions
    tests = [_test("chance", 1 / offered, shares - 1 / offered)]
    if model is not None:
        tests.append(_model_test(answers_file, answers, people, right, model))
    usable = [i for i, answer in enumerate(answers) if _timed(answer)]

    def groups(names: Sequence[str | None], order: Sequence[str], floors: bool) -> list[Group]:
        return [
            _group(
                name,
                [i for i, n in enumerate(names) if n == name],
                answers,
                people,
                offered if floors else None,
            )
            for name in order
            if name in names
        ]

    kinds = [answer.kind for answer in answers]
    spans = [f"{a}-{b}" for a, b in itertools.pairwise(ANGLE_BINS)]
    return Figures(
        begun=answers_file.participants,
        finished=len(scores),
        questions=questions,
        distinct=len({answer.question for answer in answers}),
        candidates=offered,
        scores=scores.tolist(),
        accuracy=within(mean_estimate(shares)),
        crossed=crossed_estimate(right, people, [answer.question for answer in answers]),
        deviation=float(shares.std(ddof=1)) if len(shares) > 1 else None,
        histogram=np.bincount(scores, minlength=questions + 1).tolist(),
        shapiro=_shapiro(shares),
        tests=tests,
        by_kind=groups(kinds, sorted(set(kinds)), floors=True),
        by_angle=groups([_span(answer, spans) for answer in answers], spans, floors=False),
        line=_line(answers, people, range(len(answers))),
        timed=len(usable),
        references=references(kinds, offered),
    )


def _timed(answer: Answer) -> bool:
    """Return whether an answer's time is known and from one uninterrupted look at the question."""
    return answer.response_seconds is not None and answer.times_shown == 1


def _span(answer: Answer, spans: Sequence[str]) -> str | None:
    if answer.angle_degrees is None:
        return None
    place = int(np.digitize(answer.angle_degrees, ANGLE_BINS)) - 1
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
