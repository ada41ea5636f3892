"""Answers to 3D-IQTT questions: which of two or three candidates is the reference, rotated?"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from metrics.measures.checks import as_float64, require, require_finite, require_some

CANDIDATES = (2, 3)  # how many answers a question may offer; the released ones offer three
MOST_CANDIDATES = max(CANDIDATES)
ABSTAINED = -1


def answers_from_scores(scores: ArrayLike) -> NDArray[np.int64]:
    """Return answers (Q,): the index of the highest of the scores (Q, A), or -1 where it is tied.

    A tie for the highest score is an abstention, and so counts as wrong. Any rule that turned it
    into an answer could be exploited: the lowest index pays wherever right answers favour a
    position, and a random one gives a model with constant scores the accuracy of chance. Only
    exactly equal scores tie; a method that wants to guess has to break the tie itself.

    Raises NonFiniteError on NaN and infinities, EmptyError without questions, MeasureError on
    another shape.
    """
    table = as_float64(scores, "scores")
    ok = table.ndim == 2 and table.shape[1] in CANDIDATES
    require(ok, "scores", f"shape {table.shape}", "(Q, 2) or (Q, 3)")
    require_finite(table, "scores")
    require_some(len(table), "scores")
    tied = np.count_nonzero(table == table.max(axis=1, keepdims=True), axis=1) > 1
    return np.where(tied, ABSTAINED, table.argmax(axis=1))
