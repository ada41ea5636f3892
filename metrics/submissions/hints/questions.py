"""Hints on answers to questions: scores that are distances."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from metrics.measures.statistics import wilson_interval
from metrics.submissions.problems import HINT, Problem
from metrics.submissions.reader import QuestionPredictions


def answer_hints(predictions: QuestionPredictions, answers: NDArray[Any]) -> list[Problem]:
    """Return a hint where the lowest score is right far more often than chance.

    Such scores are distances. The hint is given where the Wilson interval of the lowest score's
    accuracy lies above 3/2 of chance: above 1/2 of three answers, 3/4 of two. `answers` (Q,) are
    the right ones.
    """
    usable = (predictions.rows >= 0) & (predictions.rows < len(answers))
    if predictions.scores is None or not usable.any():
        return []
    lowest = predictions.scores[usable].argmin(axis=1)
    right = int(np.count_nonzero(lowest == answers[predictions.rows[usable]]))
    low, _ = wilson_interval(right, len(lowest))
    if low <= 1.5 / predictions.scores.shape[1]:
        return []
    found = f"the lowest score is right in {right} of {len(lowest)} questions: scores look like"
    return [Problem("scores", HINT, "the highest score for the best", f"{found} distances")]
