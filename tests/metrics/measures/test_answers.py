"""Answers from scores: the highest wins, and ties abstain."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from metrics.measures.answers import ABSTAINED, answers_from_scores
from metrics.measures.checks import MeasureError


def test_the_highest_score_is_the_answer_and_a_tie_is_none():
    scores = [[0.1, 0.7, 0.2], [3, 1, 2], [-5.0, -4.0, -3.0], [1, 1, 0], [0, 2, 2], [1, 1, 1]]
    assert answers_from_scores(scores).tolist() == [1, 0, 2, -1, -1, -1]
    assert answers_from_scores([[0.2, 0.1], [0.0, 3.0], [1, 1]]).tolist() == [0, 1, -1]
    for candidates in (1, 4):
        with pytest.raises(MeasureError):
            answers_from_scores(np.eye(4)[:, :candidates])


@given(st.integers(0, 2**32 - 1))
def test_order_of_candidates_and_questions_does_not_matter(seed):
    rng = np.random.default_rng(seed)
    scores = rng.integers(0, 4, (30, 3))
    answers, candidates, questions = answers_from_scores(scores), *map(rng.permutation, (3, 30))
    moved = answers_from_scores(scores[questions][:, candidates])
    found = np.where(moved == ABSTAINED, ABSTAINED, candidates[moved])
    assert np.array_equal(found, answers[questions])
