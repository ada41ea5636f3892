"""Skill, and its paired interval against resampling by plain loops."""

import numpy as np
import pytest

from metrics.measures.checks import MeasureError
from metrics.measures.skill import skill, skill_intervals

RNG = np.random.default_rng(8)
FLOORS = RNG.gamma(2.0, 0.1, 60)


def skill_interval(scores, floors, seed):
    """That of one skill."""
    low, high = skill_intervals(np.array(scores)[:, None], np.array(floors)[:, None], seed)
    return low.item(), high.item()


def test_perfect_is_1_and_the_floor_is_0():
    for floor in (1e-9, 0.3, 5.0):
        assert (skill(0.0, floor, False), skill(floor, floor, False)) == (1.0, 0.0)
        assert skill(2 * floor, floor, False) == -1.0
    for floor in (-0.2, 0.0, 0.7):
        assert (skill(1.0, floor, True), skill(floor, floor, True)) == (1.0, 0.0)
    assert skill(0.4, 0.6, True) == pytest.approx(-0.5)
    assert skill(0.0, 0.0, False) is skill(1.0, 1.0, True) is None


@pytest.mark.parametrize("factor", [0.0, 0.1, 1.0, 3.7])
def test_a_multiple_of_the_floor_has_an_interval_of_no_width(factor):
    low, high = skill_interval(factor * FLOORS, FLOORS, 0)
    assert (low, high) == (pytest.approx(1.0 - factor, abs=1e-12),) * 2
    if factor in (0.0, 1.0):
        assert low == high == 1.0 - factor


def test_the_interval_is_that_of_a_plain_loop():
    scores = FLOORS * RNG.uniform(0.0, 1.9, 60)
    ratio = scores.sum() / FLOORS.sum()

    def spread(score, floor, about):
        return np.std(score - about * floor) / floor.mean()

    scaled = []
    for d in np.random.default_rng(2).integers(0, 60, (500, 60)):
        mine = scores[d].sum() / FLOORS[d].sum()
        scaled.append((mine - ratio) / spread(scores[d], FLOORS[d], mine))
    error = spread(scores, FLOORS, ratio)
    low, high = 1.0 - ratio + error * np.quantile(scaled, [0.025, 0.975])
    found = skill_intervals(scores[:, None], FLOORS[:, None], 2, 500)
    assert (found[0].item(), found[1].item()) == pytest.approx((low, high))


def test_skills_that_share_their_resamples_have_the_intervals_of_each_alone():
    scores = np.stack([FLOORS * RNG.uniform(0.3, 0.9, 60), FLOORS, np.zeros(60)], axis=-1)
    floors = np.stack([FLOORS, FLOORS, np.eye(60)[0]], axis=-1)
    together = np.transpose(skill_intervals(scores, floors, 0))
    assert np.isnan(together[2]).all()  # most resamples leave its only floor out
    for k in (0, 1):
        alone = skill_interval(scores[:, k], floors[:, k], 0)
        assert together[k] == pytest.approx(alone, abs=1e-12)


def test_where_there_is_no_interval():
    assert np.isnan(skill_interval([0.1], [0.2], 0)).all()
    # Among three scenes of which one has objects, some resamples have none.
    assert np.isnan(skill_interval([0.1, 0.0, 0.0], [0.2, 0.0, 0.0], 0)).all()
    for scores, floors in (([0.1, 0.2], [0.0, 0.0]), ([0.1], [0.1, 0.2]), ([], [])):
        with pytest.raises(MeasureError):
            skill_interval(scores, floors, 0)
