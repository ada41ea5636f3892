"""Hints on answers to questions: scores that are distances."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from metrics.measures.statistics import wilson_interval
from metrics.submissions.problems import HINT, Problem
from metrics.submissions.reader import QuestionPredictions


def answer_hints(predictions: QuestionPredictions, answers: NDArray[Any]) -> list[Problem]:
    """Return a hint where the answers are right far more often after undoing a mistake.

    These are scores that are distances, of which the lowest is right, and answers that are counted
    from 1. The hint is given where the Wilson interval of the mended accuracy lies above 3/2 of
    chance: above 1/2 of three answers, 3/4 of two. `answers` (Q,) are the right ones.
    """
    usable = (predictions.rows >= 0) & (predictions.rows < len(answers))
    if not usable.any():
        return []
    right = answers[predictions.rows[usable]]
    given = predictions.answers[usable]
    offered = int(answers.max()) + 1
    hints = []
    if predictions.scores is not None:
        lowest = predictions.scores[usable].argmin(axis=1)
        if _clear(lowest == right, predictions.scores.shape[1]):
            found = f"the lowest score is right in {np.count_nonzero(lowest == right)} of"
            found = f"{found} {len(right)} questions: scores look like distances"
            hints.append(Problem("scores", HINT, "the highest score for the best", found))
    elif (given > 0).all() and (_clear(given - 1 == right, offered) or given.max() == offered):
        found = "none is 0, and the next lower ones are right more often: they look counted from 1"
        hints.append(Problem("answer", HINT, "answers counted from 0", found))
    return hints


def _clear(right: NDArray[np.bool_], offered: int) -> bool:
    low, _ = wilson_interval(int(np.count_nonzero(right)), len(right))
    return low > 1.5 / offered
