"""Small patterns tell a marked picture, wherever the mark is."""

import numpy as np

from iqtt.audit.probes.patterns import pattern_responses
from iqtt.audit.probes.trees import among_others, choose


def test_a_mark_is_found_wherever_it_is(monkeypatch):
    monkeypatch.setattr("iqtt.audit.probes.trees.FOLDS", 2)
    images = 0.2 * np.random.default_rng(2).random((120, 3, 16, 16), np.float32)
    right = np.arange(120) % 3
    for k, (y, x) in enumerate(np.random.default_rng(3).integers(2, 12, (120, 2)).tolist()):
        images[k, right[k], y : y + 3, x : x + 3] += 0.8
    responses = pattern_responses(images)
    assert (choose(among_others(responses), right) == right).mean() > 0.95
    np.testing.assert_array_equal(pattern_responses(images), responses)


def test_flat_pictures_respond_to_nothing():
    assert not pattern_responses(np.ones((2, 3, 16, 16), np.float32)).any()
