"""Accuracy on 3D-IQTT questions: which of three candidates is the reference, rotated?"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from metrics.measures.checks import as_float64, require, require_finite, require_some
from metrics.measures.statistics import Estimate, wilson_interval

CANDIDATES = 3
ABSTAINED = -1
CHANCE = 1.0 / CANDIDATES


def answers_from_scores(scores: ArrayLike) -> NDArray[np.int64]:
    """Return answers (Q,): the index of the highest of the scores (Q, 3), or -1 where it is tied.

    A tie for the highest score is an abstention, and so counts as wrong. Any rule that turned it
    into an answer could be exploited: the lowest index pays wherever right answers favour a
    position, and a random one gives a model with constant scores the accuracy of chance. Only
    exactly equal scores tie; a method that wants to guess has to break the tie itself.

    Raises NonFiniteError on NaN and infinities, EmptyError without questions, MeasureError on
    another shape.
    """
    table = as_float64(scores, "scores")
    ok = table.ndim == 2 and table.shape[1] == CANDIDATES
    require(ok, "scores", f"shape {table.shape}", f"(Q, {CANDIDATES})")
    require_finite(table, "scores")
    require_some(len(table), "scores")
    tied = np.count_nonzero(table == table.max(axis=1, keepdims=True), axis=1) > 1
    return np.where(tied, ABSTAINED, table.argmax(axis=1))


def iqtt_accuracy(answers: ArrayLike, truth: ArrayLike, confidence: float = 0.95) -> Estimate:
    """Return the fraction of right answers, in [0, 1], with Wilson's interval; chance is 1/3.

    Source: Pix2Shape, section "3D-IQTT" and Table 3: the percentage of questions answered
    correctly, here as a fraction. The interval takes questions as independent.

    Args:
        answers: (Q,) integers 0, 1, 2, or -1 for an abstention, which counts as wrong.
        truth: (Q,) integers 0, 1, 2.
        confidence: of the interval.

    Raises EmptyError without questions, MeasureError on other values or shapes.
    """
    given = _require_answers(answers, "answers", ABSTAINED)
    true = _require_answers(truth, "true answers", 0)
    require(given.shape == true.shape, "answers", len(given), f"one for each of {len(true)}")
    right, n = int(np.count_nonzero(given == true)), len(true)
    return Estimate(right / n, *wilson_interval(right, n, confidence), n)


def _require_answers(values: ArrayLike, what: str, least: int) -> NDArray[np.int64]:
    array = np.asarray(values)
    ok = array.ndim == 1 and (not array.size or array.dtype.kind in "iu")
    require(ok, what, f"{array.dtype} {array.shape}", "integers of shape (Q,)")
    require_some(array.size, what)
    wrong = (array < least) | (array >= CANDIDATES)
    first = int(np.argmax(wrong))
    found = f"{np.count_nonzero(wrong)} of {len(array)} others, first {array[first]} at {first}"
    require(not wrong.any(), what, found, f"{least} to {CANDIDATES - 1}")
    return array.astype(np.int64)
