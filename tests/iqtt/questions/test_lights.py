"""Lights of questions: uniform within their bounds, and as bright as is said."""

from dataclasses import replace

import numpy as np
from scipy import stats
from scipy.spatial.transform import Rotation

from iqtt.questions.lights import FACE_STEPS, draw_lights, propose_lights
from iqtt.questions.packing import cube_centres
from iqtt.questions.specs import SplitSpec


def test_lights_are_uniform_where_they_may_be():
    spec = SplitSpec(lights=(1, 4))
    position, color, count = propose_lights(spec, np.random.default_rng(2), 8000, 7.5)
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
    beside = np.einsum("ni,nji->nj", direction[:, 0, :2], direction[:, 1:, :2])
    assert (beside < 1e-12).all()  # on the other side of the camera
    level = color.max(axis=2) / 30.0**2
    np.testing.assert_allclose(level.sum(axis=1), spec.light_level)
    np.testing.assert_allclose(level[used], (spec.light_level / count)[np.nonzero(used)[0]])
    assert (color[used].min(axis=1) >= 0.3 * color[used].max(axis=1)).all()
    same = propose_lights(SplitSpec(lights=(3, 3)), np.random.default_rng(0), 5, 7.5)[2]
    assert same.tolist() == [3] * 5


def test_directions_of_faces_have_colours_of_their_own():
    """By the light at the middle of each cube's faces; one lamp seldom does."""
    spec, rng = SplitSpec(), np.random.default_rng(5)
    cubes = np.tile([[0, 0, 0], [1, 0, 0], [2, 0, 0], [2, 1, 0], [2, 1, 1]], (60, 1, 1))
    turns, centres = Rotation.random(60, rng).as_matrix(), cube_centres(list(cubes), 5)
    position, color, _ = draw_lights(spec, rng, cubes, turns, 12.0)
    refused = 0
    for lamps in ((position, color), propose_lights(spec, rng, 60, 12.0)[:2]):
        for centre, turn, lamp, rgb in zip(centres, turns, *lamps, strict=True):
            shown = []
            for normal in turn.T.tolist() + (-turn.T).tolist():
                points = centre @ turn.T + np.array(normal) / 2
                points = points[((0, 0, 12) - points) @ normal > 0]
                away = lamp - points[:, None]
                far = np.linalg.norm(away, axis=2, keepdims=True)
                light = (np.maximum(away @ normal, 0)[..., None] / far**3 * rgb).sum(axis=1)
                shown += [255 * 0.8 * (0.2 + light)] if len(points) else []
            gaps = [max((a.min(axis=0) - b.max(axis=0)).max() for a, b in ((p, q), (q, p)))
                    for i, p in enumerate(shown) for q in shown[:i]]  # fmt: skip
            refused += min(gaps) < FACE_STEPS
        if lamps[0] is position:
            assert refused == 0
    assert refused > 3
    dark = replace(spec, light_level=0.01)
    assert draw_lights(dark, rng, cubes[:1], turns[:1], 12.0) is None
