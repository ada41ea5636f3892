"""Hints on answers: scores that are distances."""

from pathlib import Path

import numpy as np

from metrics.submissions.hints.tasks import answer_hints
from metrics.submissions.inspection import Inspection
from metrics.submissions.reader import QuestionPredictions


def answered(scores, rows=None):
    """A submission with these scores (Q, 3)."""
    rows = np.arange(len(scores)) if rows is None else rows
    arrays = {} if scores is None else {"scores": scores}
    content = Inspection("iqtt", arrays=arrays, ids=rows, answers=0 * rows)
    return QuestionPredictions(Path(__file__), content, None)


def test_scores_that_are_distances():
    rng = np.random.default_rng(7)
    right = rng.integers(0, 3, 300)
    scores = rng.random((300, 3))
    assert answer_hints(answered(scores), right) == []
    scores[np.arange(300), right] += 0.5
    assert answer_hints(answered(scores), right) == []
    (hint,) = answer_hints(answered(-scores), right)
    assert hint.is_hint
    assert "distances" in hint.found
    assert answer_hints(answered(-scores[:3]), right) == [], "too few to tell"
    assert answer_hints(answered(None, np.arange(3)), right) == []


def test_answers_that_are_counted_from_one():
    rng = np.random.default_rng(8)
    right = rng.integers(0, 3, 300)
    rows = np.arange(300)

    def hints(answers):
        content = Inspection("iqtt", arrays={}, ids=rows, answers=answers)
        return answer_hints(QuestionPredictions(Path(__file__), content, None), right)

    assert hints(right) == []
    assert hints(rng.integers(0, 3, 300)) == []
    assert hints(np.full(300, 1)) == []
    (hint,) = hints(right + 1)
    assert (hint.is_hint, hint.dataset) == (True, "answer")
    (hint,) = hints(rng.integers(1, 4, 300))
    assert hint.dataset == "answer"
