"""Accuracy on questions: ties, abstentions, groups, and answers that are none."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from metrics.measures.answers import (
    Accuracy,
    accuracy_by_group,
    answers_from_scores,
    iqtt_accuracy,
    right_answers,
)
from metrics.measures.checks import EmptyError, NonFiniteError
from metrics.measures.statistics import wilson_interval


def test_by_hand():
    found = iqtt_accuracy([0, 1, 2, -1], [0, 1, 1, 2])
    assert found == Accuracy(0.5, *wilson_interval(2, 4), right=2, abstained=1, n=4)


def test_the_highest_score_is_the_answer_and_a_tie_is_none():
    scores = [[0.1, 0.7, 0.2], [3, 1, 2], [-5.0, -4.0, -3.0], [1, 1, 0], [0, 2, 2], [1, 1, 1]]
    assert answers_from_scores(scores).tolist() == [1, 0, 2, -1, -1, -1]


def test_scores_that_say_nothing_earn_nothing():
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


def test_groups_add_up_and_come_in_order():
    rng = np.random.default_rng(0)
    answers, truth = rng.integers(-1, 3, 60), rng.integers(0, 3, 60)
    kinds = rng.choice(["mirror", "swap", "cube"], 60)
    groups = accuracy_by_group(answers, truth, kinds)
    assert list(groups) == ["cube", "mirror", "swap"]
    assert sum(group.right for group in groups.values()) == iqtt_accuracy(answers, truth).right
    assert groups["swap"] == iqtt_accuracy(answers[kinds == "swap"], truth[kinds == "swap"])
    by_position = accuracy_by_group(truth, truth, truth)
    assert {key: group.value for key, group in by_position.items()} == {0: 1.0, 1: 1.0, 2: 1.0}


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_non_finite_scores_are_named(bad):
    with pytest.raises(NonFiniteError, match=r"scores: 1 of 6 .* at index \(1, 2\)"):
        answers_from_scores([[1.0, 2.0, 3.0], [1.0, 2.0, bad]])


def test_wrong_input_is_named():
    for bad in ([[1.0, 2.0]], [1.0, 2.0, 3.0], np.zeros((2, 3, 1)), [["a", "b", "c"]]):
        with pytest.raises(ValueError, match="scores"):
            answers_from_scores(bad)
    with pytest.raises(EmptyError):
        answers_from_scores(np.zeros((0, 3)))
    for bad in ([0.0, 1.0], [True, False], ["0", "1"], [[0], [1]], [3, 0], [-2, 0], [None, 0]):
        with pytest.raises(ValueError, match=r"^answers: "):
            right_answers(bad, [0, 1])
    with pytest.raises(ValueError, match=r"true answers: 1 of 2 .* is -1 at index 1"):
        right_answers([0, 1], [0, -1])
    with pytest.raises(ValueError, match="1 answers to 2 questions"):
        right_answers([0], [0, 1])
    with pytest.raises(EmptyError):
        iqtt_accuracy([], [])
    with pytest.raises(EmptyError):
        right_answers([], [])
    with pytest.raises(ValueError, match="group labels"):
        accuracy_by_group([0, 1], [0, 1], [0])


def test_unsigned_and_large_answers_are_read_as_they_are():
    assert right_answers(np.array([2, 0], dtype=np.uint8), [2, 1]).tolist() == [True, False]
    with pytest.raises(ValueError, match="outside -1 to 2"):
        right_answers(np.array([2**64 - 1], dtype=np.uint64), [2])
