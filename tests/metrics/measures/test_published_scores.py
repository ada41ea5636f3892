"""Scores that the field uses, against their published formulas written pixel by pixel."""

import math

import numpy as np
import pytest

from metrics.measures.boundaries import boundary_scores
from metrics.measures.depth import compare_depth, depth_scores
from metrics.measures.surfaces.points import local_point_scores, point_map_scores

RNG = np.random.default_rng(5)
TRUE = RNG.uniform(0.5, 3.0, (9, 11))
PREDICTED = TRUE * RNG.uniform(0.7, 1.6, TRUE.shape)
MASK = RNG.random(TRUE.shape) < 0.9


def pixels():
    return [(float(p), float(t)) for p, t in zip(PREDICTED[MASK], TRUE[MASK], strict=True)]


def mean(values):
    values = list(values)
    return math.fsum(values) / len(values)


PUBLISHED = {  # Eigen et al. 2014, the KITTI benchmark, and Make3D
    "mse_depth": lambda pairs: mean((p - t) ** 2 for p, t in pairs),
    "rmse": lambda pairs: math.sqrt(mean((p - t) ** 2 for p, t in pairs)),
    "abs_rel": lambda pairs: mean(abs(p - t) / t for p, t in pairs),
    "sq_rel": lambda pairs: mean((p - t) ** 2 / t for p, t in pairs),
    "rmse_log": lambda pairs: math.sqrt(mean((math.log(p) - math.log(t)) ** 2 for p, t in pairs)),
    "log10": lambda pairs: mean(abs(math.log10(p) - math.log10(t)) for p, t in pairs),
    "irmse": lambda pairs: math.sqrt(mean((1 / p - 1 / t) ** 2 for p, t in pairs)),
    "silog": lambda pairs: (
        100
        * math.sqrt(
            mean(math.log(p / t) ** 2 for p, t in pairs)
            - mean(math.log(p / t) for p, t in pairs) ** 2
        )
    ),
    "delta_1": lambda pairs: mean(max(p / t, t / p) < 1.25 for p, t in pairs),
    "delta_2": lambda pairs: mean(max(p / t, t / p) < 1.25**2 for p, t in pairs),
    "delta_3": lambda pairs: mean(max(p / t, t / p) < 1.25**3 for p, t in pairs),
}


@pytest.mark.parametrize("name", PUBLISHED)
def test_depth(name):
    found = depth_scores(compare_depth(PREDICTED, TRUE, MASK))
    assert found.keys() == PUBLISHED.keys()
    assert found[name] == pytest.approx(PUBLISHED[name](pixels()), rel=1e-9)


def boundaries(depth, ratio):
    """Depth Pro: which neighbours lie behind a pixel by more than the ratio, in four directions."""
    height, width = depth.shape
    found = {}
    for way in ((0, 1), (0, -1), (1, 0), (-1, 0)):
        found[way] = set()
        for i in range(height):
            for j in range(width):
                k, m = i + way[0], j + way[1]
                inside = 0 <= k < height and 0 <= m < width
                if inside and MASK[i, j] and MASK[k, m] and depth[k, m] / depth[i, j] > ratio:
                    found[way].add((i, j))
    return found


def test_boundaries():
    f1, recall, total = 0.0, 0.0, 0.0
    for ratio in np.linspace(1.05, 1.25, 10).tolist():
        said, true = boundaries(PREDICTED, ratio), boundaries(TRUE, ratio)
        r = mean(len(said[way] & true[way]) / max(len(true[way]), 1) for way in said)
        p = mean(len(said[way] & true[way]) / max(len(said[way]), 1) for way in said)
        found_of_all = sum(len(said[way] & true[way]) for way in said)
        recall += ratio * found_of_all / sum(map(len, true.values()))
        f1, total = f1 + ratio * 2 * r * p / (r + p), total + ratio
    found = boundary_scores(PREDICTED, TRUE, MASK)
    assert found["boundary_f1"] == pytest.approx(f1 / total)
    assert found["boundary_recall"] == pytest.approx(recall / total)


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


def test_point_maps():
    true = RNG.normal(size=(40, 3)) + np.array([0.0, 0.0, -4.0])
    said = true + 0.8 * RNG.normal(size=(40, 3))
    errors, far, near = (
        [math.dist(a, b) for a, b in zip(x, y, strict=True)]
        for x, y in ((said, true), (true, 0 * true), (said, 0 * true))
    )
    found = point_map_scores(said, true)
    assert found["points_rel"] == pytest.approx(
        mean(e / f for e, f in zip(errors, far, strict=True))
    )
    within = mean(e < 0.25 * min(a, b) for e, a, b in zip(errors, far, near, strict=True))
    assert found["points_delta_1"] == within
    assert point_map_scores(3.0 * true, true, "scale")["points_rel_after_scale"] < 1e-12
    moved = 0.2 * true + [1.0, 2.0, 3.0]
    assert point_map_scores(moved, true, "scale_shift")["points_rel_after_scale_shift"] < 1e-12


def test_local_points():
    """Each object after its own scale and shift; errors in its diameter."""
    true = RNG.normal(size=(30, 3))
    ids = np.repeat([0, 2, 5], 10)
    said = true.copy()
    said[ids == 2] = 0.5 * true[ids == 2] + [3.0, 0.0, 1.0]
    assert local_point_scores(said, true, ids) == {
        "local_points_rel": pytest.approx(0.0, abs=1e-12),
        "local_points_delta_1": 1.0,
    }
    said[ids == 5] = said[ids == 5].mean(axis=0)  # one point for all
    own = true[ids == 5]
    rel = [math.dist(p, own.mean(axis=0)) / max(np.ptp(own, axis=0)) for p in own]
    found = local_point_scores(said, true, ids)
    assert found["local_points_rel"] == pytest.approx(mean(rel) / 2)
    assert found["local_points_delta_1"] == (1.0 + mean(r < 0.25 for r in rel)) / 2
    assert np.isnan(list(local_point_scores(said, true, 0 * ids).values())).all()
