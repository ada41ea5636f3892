"""Rotations of views: uniform, told apart over every symmetry, and silent about the answer."""

import math
from dataclasses import replace

import numpy as np
import pytest
from polycubes import turns_between
from scipy import stats
from scipy.spatial.transform import Rotation

from iqtt.questions.distractors import Shapes, draw_shapes, make_pools
from iqtt.questions.specs import SplitSpec
from iqtt.questions.views import (
    Tally,
    draw_rotations,
    far_enough,
    random_frames,
    rotation_angle_degrees,
    sample_questions,
)
from iqtt.shapes.polycube import symmetries

SPEC = SplitSpec(seed=4, cubes=(5, 8), height=64, width=64, min_cube_pixels=3, lights=(1, 3))
RNG = np.random.default_rng


def test_rotations_are_uniform_on_so3():
    matrices = draw_rotations(np.random.default_rng(5), (40, 500)).reshape(-1, 3, 3)
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


def test_frames_change_no_cube_in_the_world_and_tell_nothing():
    """Each of the 24 comes as often for each image, independently of the others."""
    shapes = Shapes(draw_shapes(make_pools(SPEC), "val", [(0, 0)])[0][0][[0, 0, 1, 2]], None, 0)
    turns, rng = draw_rotations(RNG(1), (4,)), RNG(2)
    relative = []
    for _ in range(600):
        framed, turned = random_frames(shapes, turns, rng)
        assert (framed.cubes.min(axis=1) == 0).all()
        for k in range(4):
            before, after = (
                sorted(((c - (c.min(axis=0) + c.max(axis=0)) / 2) @ t.T).round(9).tolist())
                for c, t in ((shapes.cubes[k], turns[k]), (framed.cubes[k], turned[k]))
            )
            np.testing.assert_allclose(before, after, atol=1e-8)
        frames = np.rint(np.swapaxes(turned, 1, 2) @ turns).astype(int)
        relative.append([(frames[0] @ frames[k].T).ravel() for k in (1, 2, 3)])
    for k in range(3):
        _, counts = np.unique([row[k] for row in relative], axis=0, return_counts=True)
        assert len(counts) == 24
        assert stats.chisquare(counts).pvalue > 1e-3
    first = {random_frames(shapes, turns, rng)[0].cubes[1].tobytes() for _ in range(60)}
    assert len(first) > 50, "cubes come in random order"


@pytest.mark.parametrize("kind", ["mirror", "near"])
def test_stored_rotations_tell_nothing_about_the_answer(kind):
    """The angle from the reference's to each answer's, and the least of all its 24 versions."""
    spec = replace(SPEC, distractors=kind, cubes=(6, 8))
    requests = [(i, i % 3, 0) for i in range(400)]
    wins = []
    for question in sample_questions(make_pools(spec), "val", requests, Tally()):
        between = question.world_from_shape[0].T @ question.world_from_shape[1:]
        wins.append([np.trace(turn) for turn in between])
    wins = np.argsort(wins, axis=1)
    for place in (0, 2):
        right = sum(int(row[place] == i % 3) for i, row in enumerate(wins))
        assert stats.binomtest(right, len(wins), 1 / 3).pvalue > 1e-3


@pytest.mark.parametrize(("least", "sight"), [(30, 0), (90, 0), (0, 25), (30, 60)])
def test_far_enough_is_just_so_many_degrees(least, sight):
    """Lines of sight are compared by brute force, over the shape's symmetries, from SciPy."""
    shapes = ([[0, 0, 0], [1, 0, 0]], [[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0, 0]])
    symmetric = np.stack([symmetries(np.array([shape]))[0] for shape in shapes])
    turns = draw_rotations(np.random.default_rng(0), (4, 500))
    spec = replace(SPEC, min_angle_degrees=least, min_sight_angle_degrees=sight)
    mirrored = np.array([[False, True, True]])
    far = far_enough(spec, turns[:1, 0], turns[None, 1:], symmetric[None], mirrored)
    reference = turns[0, 0]
    for k, shape in enumerate(shapes):
        own = turns_between(np.array(shape), np.array(shape))
        seen = reference[2] * (-1, 1, 1) if mirrored[0, k] else reference[2]
        axes = np.array([turn.apply(seen) for turn in own])
        between = np.degrees(np.arccos(np.abs(turns[1 + k, :, 2] @ axes.T).max(axis=1)))
        angles = [rotation_angle_degrees(reference, turn, symmetric[k]) for turn in turns[1 + k]]
        assert (far[0, k] == ((np.array(angles) >= least) & (between >= sight))).all()
    assert far[0, :2].any()
    assert not far.all()


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
    group = turns_between(cubes, cubes)
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
