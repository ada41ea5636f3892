"""Accuracy on 3D-IQTT questions: which of three candidates is the reference, rotated."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from metrics.measures.checks import EmptyError, as_float64, require_finite
from metrics.measures.statistics import wilson_interval

CANDIDATES = 3
ABSTAINED = -1
CHANCE = 1.0 / CANDIDATES


@dataclass(frozen=True)
class Accuracy:
    """A fraction of right answers with its Wilson interval; all values in [0, 1]."""

    value: float
    low: float
    high: float
    right: int
    abstained: int
    n: int


def answers_from_scores(scores: ArrayLike) -> NDArray[np.int64]:
    """Answers (Q,): the index of the highest of the scores (Q, 3), or -1 where it is tied.

    A tie for the highest score is an abstention, and so counts as wrong. Any rule that turned it
    into an answer could be gamed: the lowest index pays wherever right answers favour a position,
    a random one pays a third for scores that say nothing, and both let a collapsed model pass for
    one at chance. So a tie never pays; who wants to guess must say the guess. Only exactly equal
    scores tie. Raises NonFiniteError on NaN and infinities.
    """
    table = as_float64(scores, "scores")
    if table.ndim != 2 or table.shape[1] != CANDIDATES:
        raise ValueError(f"scores: expected shape (Q, {CANDIDATES}), got {table.shape}")
    require_finite(table, "scores")
    if len(table) == 0:
        raise EmptyError("scores: there are no questions")
    tied = np.count_nonzero(table == table.max(axis=1, keepdims=True), axis=1) > 1
    return np.where(tied, ABSTAINED, table.argmax(axis=1))


def right_answers(answers: ArrayLike, truth: ArrayLike) -> NDArray[np.bool_]:
    """Which answers (Q,) are right. Answers are 0, 1, 2, or -1 (abstained): never right."""
    given = _require_answers(answers, "answers", ABSTAINED)
    true = _require_answers(truth, "true answers", 0)
    if given.shape != true.shape:
        raise ValueError(f"got {len(given)} answers to {len(true)} questions")
    right: NDArray[np.bool_] = given == true
    return right


def iqtt_accuracy(answers: ArrayLike, truth: ArrayLike, confidence: float = 0.95) -> Accuracy:
    """Right answers / questions; abstentions are wrong. Chance is 1/3.

    Source: Pix2Shape, section "3D-IQTT" ("the percentage of questions answered correctly", here as
    a fraction); the interval is Wilson's (`statistics.wilson_interval`), which takes questions as
    independent.
    """
    right = right_answers(answers, truth)
    count, n = int(np.count_nonzero(right)), len(right)
    low, high = wilson_interval(count, n, confidence)
    abstained = int(np.count_nonzero(np.asarray(answers) == ABSTAINED))
    return Accuracy(count / n, low, high, count, abstained, n)


def accuracy_by_group(
    answers: ArrayLike, truth: ArrayLike, groups: ArrayLike, confidence: float = 0.95
) -> dict[Any, Accuracy]:
    """`iqtt_accuracy` of the questions of each group, by label in sorted order.

    `groups` (Q,) holds one label per question: kind of distractor, position of the right answer,
    bin of the rotation angle. Each interval stands alone; it is not corrected for their number.
    """
    given, true, labels = np.asarray(answers), np.asarray(truth), np.asarray(groups)
    right_answers(given, true)  # checks them all, so that a fault is reported as a whole
    if labels.shape != given.shape:
        raise ValueError(f"got group labels {labels.shape} for answers {given.shape}")
    return {
        label: iqtt_accuracy(given[labels == label], true[labels == label], confidence)
        for label in np.unique(labels).tolist()
    }


def _require_answers(values: ArrayLike, what: str, least: int) -> NDArray[np.int64]:
    array = np.asarray(values)
    if array.ndim != 1 or (array.size and array.dtype.kind not in "iu"):
        raise ValueError(
            f"{what}: expected integers of shape (Q,), got {array.dtype} {array.shape}"
        )
    if array.size == 0:
        raise EmptyError(f"{what}: there are no questions")
    wrong = (array < least) | (array >= CANDIDATES)
    if wrong.any():
        first = int(np.argmax(wrong))
        raise ValueError(
            f"{what}: {np.count_nonzero(wrong)} of {len(array)} are outside {least} to "
            f"{CANDIDATES - 1}; the first is {array[first]} at index {first}"
        )
    return array.astype(np.int64)
