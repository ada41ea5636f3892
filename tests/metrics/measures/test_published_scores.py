"""Boundaries where the published score is odd; `test_definitions` has the formulas."""

import numpy as np
import pytest

from metrics.measures.boundaries import boundary_scores

RNG = np.random.default_rng(5)


def test_boundaries_that_lack_a_direction_count_as_published():
    """One step, in one direction of four and at five ratios of ten: the truth itself has .21."""
    flat = np.ones((6, 6))
    step = np.where(np.arange(6) < 3, 1.0, 1.1) * flat
    whole = np.ones_like(flat, bool)
    ratios = np.linspace(1.05, 1.25, 10)
    expected = 0.25 * ratios[ratios < 1.1].sum() / ratios.sum()
    for scale in (1.0, 7.0):
        found = boundary_scores(scale * step, step, whole)
        assert found == {"boundary_f1": pytest.approx(expected), "boundary_recall": 1.0}
    assert set(boundary_scores(flat, step, whole).values()) == {0.0}
    found = boundary_scores(step, flat, whole)
    assert found["boundary_f1"] == 0.0
    assert np.isnan(found["boundary_recall"])


def test_recall_is_of_all_true_boundaries_and_needs_no_precision():
    """Noise adds boundaries of its own, and hides none."""
    true = np.where(np.arange(12) < 6, 1.0, 2.0) * np.ones((8, 1))
    said = true * RNG.choice([1.0, 1.3], true.shape, p=[0.7, 0.3])
    found = boundary_scores(said, true, np.ones_like(true, bool))
    kept = np.mean(said[:, 6] / said[:, 5] > 1.25)
    assert found["boundary_recall"] == pytest.approx(kept)
    assert found["boundary_f1"] < 0.5 * kept
