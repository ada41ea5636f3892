"""Positions of the answers, rotations and lights: balanced, uniform, and measured rightly."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats
from scipy.spatial.transform import Rotation

from iqtt.questions.draws import draw_lights, draw_rotations, rotation_angle_degrees
from iqtt.questions.sampling import (
    answer_positions,
    question_key,
)
from iqtt.questions.specs import SPLITS, SplitSpec
from iqtt.shapes.polycube import symmetries

SPEC = SplitSpec(seed=11)
RNG = np.random.default_rng


@pytest.mark.parametrize("count", [0, 1, 2, 3, 4, 200, 1001])
def test_answer_positions_are_balanced_exactly(count):
    for split in SPLITS:
        places = answer_positions(SPEC, split, 7, count)
        assert (places.dtype, places.shape) == (np.uint8, (count,))
        assert sorted(places.tolist()) == sorted(i % 3 for i in range(count))
        others = replace(SPEC, train=7, labeled=3, val=8, test=9, cubes=(9, 9))
        assert (answer_positions(others, split, 7, count) == places).all()


def test_answer_positions_follow_no_pattern():
    rows = np.array([answer_positions(replace(SPEC, seed=s), "val", 0, 6) for s in range(600)])
    for column in rows.T:
        assert stats.chisquare(np.bincount(column, minlength=3)).pvalue > 1e-4
    assert len({row.tobytes() for row in rows}) > 85, "of 90 orders"
    tables = [(split, first) for split in SPLITS for first in (0, 30)]
    orders = {answer_positions(SPEC, split, first, 30).tobytes() for split, first in tables}
    assert len(orders) == 6
    keys = {question_key(split, index) for split in SPLITS for index in (0, 1, 10**8)}
    assert len(keys) == 9


def test_rotations_are_uniform_on_so3():
    matrices = draw_rotations(RNG(5), (40, 500)).reshape(-1, 3, 3)
    assert abs(matrices @ matrices.swapaxes(1, 2) - np.eye(3)).max() < 1e-14
    assert abs(np.linalg.det(matrices) - 1).max() < 1e-13
    turns = Rotation.from_matrix(matrices)
    angle = turns.magnitude()
    assert stats.kstest(angle, lambda t: (t - np.sin(t)) / np.pi).pvalue > 1e-3
    axis = turns.as_rotvec() / angle[:, None]
    for vectors in (axis, matrices[:, :, 0], matrices[:, 1]):
        for column in vectors.T:  # uniform on the sphere, so in each coordinate
            assert stats.kstest(column, stats.uniform(-1, 2).cdf).pvalue > 1e-3
    assert abs(np.corrcoef(matrices.reshape(-1, 9).T) - np.eye(9)).max() < 0.03


def test_lights_are_uniform_where_they_may_be():
    spec = replace(SPEC, lights=(1, 4))
    position, color, count = draw_lights(spec, RNG(2), 8000)
    assert position.shape == color.shape == (8000, 4, 3)
    assert stats.chisquare(np.bincount(count)[1:]).pvalue > 1e-3
    used = np.arange(4) < count[:, None]
    assert not position[~used].any()
    assert not color[~used].any()
    np.testing.assert_allclose(np.linalg.norm(position[used], axis=1), spec.light_distance)
    direction = position / spec.light_distance
    first, others = direction[:, 0], direction[:, 1:][used[:, 1:]]
    assert stats.kstest(first[:, 2], stats.uniform(0.5, 0.5).cdf).pvalue > 1e-3
    assert stats.kstest(others[:, 2], stats.uniform(-1, 2).cdf).pvalue > 1e-3
    for some in (first, others):
        around = np.arctan2(some[:, 1], some[:, 0])
        assert stats.kstest(around, stats.uniform(-np.pi, 2 * np.pi).cdf).pvalue > 1e-3
    level = color.max(axis=2) / spec.light_distance**2
    np.testing.assert_allclose(level.sum(axis=1), spec.light_level)
    np.testing.assert_allclose(level[used], (spec.light_level / count)[np.nonzero(used)[0]])
    assert (color[used].min(axis=1) >= 0.5 * color[used].max(axis=1)).all()
    same = draw_lights(replace(SPEC, lights=(3, 3)), RNG(0), 5)[2]
    assert same.tolist() == [3] * 5


SYMMETRIC = {
    "straight": [[i, 0, 0] for i in range(5)],
    "square": [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]],
    "cube": [[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)],
    "corner": [[0, 0, 0], [1, 0, 0], [1, 1, 0]],
    "screw": [[0, 0, 0], [1, 0, 0], [1, 1, 0], [1, 1, 1]],
    "none": [[0, 0, 0], [1, 0, 0], [2, 0, 0], [2, 1, 0], [2, 1, 1]],
}


@pytest.mark.parametrize("name", SYMMETRIC)
def test_the_angle_between_views_is_the_least_that_symmetry_leaves(name):
    """Against SciPy's rotations of the cube, tried on the shape one by one."""
    cubes = np.array(SYMMETRIC[name])
    centred = 2 * cubes - cubes.min(axis=0) - cubes.max(axis=0)
    group = [
        turn
        for turn in Rotation.create_group("O")
        if sorted(np.rint(turn.apply(centred)).tolist()) == sorted(centred.tolist())
    ]
    symmetric = symmetries(cubes[None])[0]
    order = {"straight": 8, "square": 8, "cube": 24, "corner": 2, "screw": 2, "none": 1}[name]
    assert len(group) == symmetric.sum() == order
    a, b = Rotation.random(40, random_state=1), Rotation.random(40, random_state=2)
    for one, other in zip(a, b, strict=True):
        expected = min((other * turn * one.inv()).magnitude() for turn in group)
        found = rotation_angle_degrees(one.as_matrix(), other.as_matrix(), symmetric)
        assert found == pytest.approx(math.degrees(expected), abs=1e-6)
        hidden = (one * group[-1]).as_matrix()
        assert rotation_angle_degrees(one.as_matrix(), hidden, symmetric) < 1e-5
