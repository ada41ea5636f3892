"""The trees of the probes: what they see, what they find, and that they do not see answers."""

import numpy as np
import pytest

from iqtt.audit.probes.patterns import pattern_responses
from iqtt.audit.probes.trees import AnswerTrees, among_others, choose, next_to_reference


def noise(seed, *shape):
    return np.random.default_rng(seed).normal(size=shape)


@pytest.mark.parametrize("answers", [2, 3])
def test_how_an_answer_stands_to_the_others(answers):
    values = noise(0, 5, answers, 2)
    found = among_others(values).reshape(5, answers, 4, 2)
    for q in range(5):
        for k in range(answers):
            others = np.delete(values[q], k, axis=0)
            mean, spread = others.mean(axis=0), others.std(axis=0)
            apart = np.abs(others - values[q, k]).sum(axis=0)
            expected = [values[q, k], values[q, k] - mean, apart, spread]
            np.testing.assert_allclose(found[q, k], expected, atol=1e-3)


@pytest.mark.parametrize("answers", [2, 3])
def test_how_an_answer_stands_to_the_reference(answers):
    values, distances = noise(0, 6, 1 + answers, 4), np.abs(noise(1, 6, answers, 3))
    found = next_to_reference(values, distances)
    assert found.shape == (6, answers, 3 * 4 + 2 * 3 + 2)
    apart = np.abs(values[:, 1:] - values[:, :1])
    np.testing.assert_allclose(found[:, :, :4], apart, atol=1e-5)
    np.testing.assert_allclose(found[:, :, 4:7], distances, atol=1e-5)
    np.testing.assert_allclose(found[:, :, 8:12], values[:, 1:] + values[:, :1], atol=1e-5)
    for k in range(answers):
        least = np.delete(distances, k, axis=1).min(axis=1)
        lead = found[:, k, 12 + 4 : 12 + 7]
        np.testing.assert_allclose(lead, distances[:, k] - least, atol=1e-5)


def test_a_planted_mark_is_found_and_places_make_no_difference():
    values, right = noise(2, 400, 3, 4), np.arange(400) % 3
    values[np.arange(400), right, 1] += 2
    columns = among_others(values)
    trees = AnswerTrees(2).fit(columns[:300], right[:300])
    scores = trees.scores(columns[300:])
    assert (scores.argmax(axis=1) == right[300:]).mean() > 0.7
    order = [2, 0, 1]
    np.testing.assert_array_equal(trees.scores(columns[300:][:, order]), scores[:, order])
    again = AnswerTrees(2).fit(columns[:300], right[:300]).scores(columns[300:])
    np.testing.assert_array_equal(again, scores)


def test_no_question_helps_to_answer_itself():
    """Trees that had seen the answers would be right in nearly all questions of noise."""
    right = np.random.default_rng(4).integers(3, size=300)
    chosen = choose(among_others(noise(3, 300, 3, 20)), right)
    assert 0.2 < (chosen == right).mean() < 0.47


def test_a_mark_is_found_wherever_it_is(monkeypatch):
    monkeypatch.setattr("iqtt.audit.probes.trees.FOLDS", 2)
    images = 0.2 * np.random.default_rng(2).random((120, 3, 16, 16), np.float32)
    right = np.arange(120) % 3
    for k, (y, x) in enumerate(np.random.default_rng(3).integers(2, 12, (120, 2)).tolist()):
        images[k, right[k], y : y + 3, x : x + 3] += 0.8
    responses = pattern_responses(images)
    assert (choose(among_others(responses), right) == right).mean() > 0.95
    np.testing.assert_array_equal(pattern_responses(images), responses)
