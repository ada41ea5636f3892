"""Lights of questions: uniform within their bounds, and as bright as is said."""

import numpy as np
from scipy import stats

from iqtt.questions.lights import draw_lights
from iqtt.questions.specs import SplitSpec


def test_lights_are_uniform_where_they_may_be():
    spec = SplitSpec(lights=(1, 4))
    position, color, count = draw_lights(spec, np.random.default_rng(2), 8000, 7.5)
    assert position.shape == color.shape == (8000, 4, 3)
    assert stats.chisquare(np.bincount(count)[1:]).pvalue > 1e-3
    used = np.arange(4) < count[:, None]
    assert not position[~used].any()
    assert not color[~used].any()
    np.testing.assert_allclose(np.linalg.norm(position[used], axis=1), 30.0)
    direction = position / 30.0
    first, others = direction[:, 0], direction[:, 1:][used[:, 1:]]
    assert stats.kstest(first[:, 2], stats.uniform(0.7, 0.2).cdf).pvalue > 1e-3
    assert stats.kstest(others[:, 2], stats.uniform(0, 0.8).cdf).pvalue > 1e-3
    for some in (first, others):
        around = np.arctan2(some[:, 1], some[:, 0])
        assert stats.kstest(around, stats.uniform(-np.pi, 2 * np.pi).cdf).pvalue > 1e-3
    level = color.max(axis=2) / 30.0**2
    np.testing.assert_allclose(level.sum(axis=1), spec.light_level)
    np.testing.assert_allclose(level[used], (spec.light_level / count)[np.nonzero(used)[0]])
    assert (color[used].min(axis=1) >= 0.3 * color[used].max(axis=1)).all()
    same = draw_lights(SplitSpec(lights=(3, 3)), np.random.default_rng(0), 5, 7.5)[2]
    assert same.tolist() == [3] * 5
