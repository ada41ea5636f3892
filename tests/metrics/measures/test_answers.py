"""Accuracy on questions: ties, abstentions, and answers of other integer types."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from metrics.measures.answers import answers_from_scores, iqtt_accuracy
from metrics.measures.statistics import Estimate, wilson_interval


def test_by_hand():
    expected = Estimate(0.5, *wilson_interval(2, 4), n=4)
    assert iqtt_accuracy([0, 1, 2, -1], [0, 1, 1, 2]) == expected
    assert iqtt_accuracy(np.array([0, 1, 2, 2], dtype=np.uint8), [0, 1, 1, 0]) == expected


def test_the_highest_score_is_the_answer_and_a_tie_is_none():
    scores = [[0.1, 0.7, 0.2], [3, 1, 2], [-5.0, -4.0, -3.0], [1, 1, 0], [0, 2, 2], [1, 1, 1]]
    assert answers_from_scores(scores).tolist() == [1, 0, 2, -1, -1, -1]


def test_constant_scores_earn_nothing():
    truth = np.arange(99) % 3
    assert iqtt_accuracy(answers_from_scores(np.zeros((99, 3))), truth).value == 0.0


@given(st.integers(0, 2**32 - 1))
def test_order_of_candidates_and_questions_does_not_matter(seed):
    rng = np.random.default_rng(seed)
    scores, truth = rng.integers(0, 4, (30, 3)), rng.integers(0, 3, 30)
    expected = iqtt_accuracy(answers_from_scores(scores), truth)
    candidates, questions = rng.permutation(3), rng.permutation(30)
    moved = answers_from_scores(scores[:, candidates])
    assert iqtt_accuracy(moved, np.argsort(candidates)[truth]) == expected
    assert iqtt_accuracy(answers_from_scores(scores)[questions], truth[questions]) == expected
