"""Questions as they are sampled: every cube shows, far enough from the reference; the search."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from polycubes import turns_between
from refusals import refused
from scipy import stats
from scipy.spatial.transform import Rotation

from iqtt.questions import views as module
from iqtt.questions.distractors import Shapes, arrange, draw_shapes, make_pools, question_rng
from iqtt.questions.specs import SplitSpec
from iqtt.questions.views import (
    Tally,
    camera_distances,
    draw_rotations,
    far_enough,
    find_views,
    random_frames,
    relations,
    rotation_angle_degrees,
    sample_questions,
    shape_symmetries,
)
from iqtt.shapes.polycube import mirror, symmetries
from scenegen.common.errors import PlacementError
from scenegen.common.random.seeding import Purpose

SPEC = SplitSpec(seed=4, cubes=(5, 8), height=64, width=64, min_cube_pixels=3, lights=(1, 3))
RNG = np.random.default_rng
REQUESTS = [(i, i % 3, 0) for i in (0, 1, 2, 3, 40, 41, 42, 10**6)]


@pytest.fixture(scope="module")
def pools():
    return make_pools(SPEC)


@pytest.fixture(scope="module")
def sampled(pools):
    tally = Tally()
    return sample_questions(pools, "val", REQUESTS, tally), tally


def bits(question):
    """All that a question is."""
    values = [*vars(question).values(), *vars(question.shapes).values()]
    return tuple(
        v.tobytes() if isinstance(v, np.ndarray) else v for v in values if v is not question.shapes
    )


@pytest.mark.parametrize("least", [0, 30, 90])
def test_answers_are_turned_far_enough_by_any_way_of_looking(pools, least):
    """Against SciPy's rotations, tried on each shape; the right answer's angle is the one told."""
    spec = replace(SPEC, min_angle_degrees=least, seed=4)
    questions = sample_questions(replace(pools, spec=spec), "train", REQUESTS, Tally())
    pairs = replace(spec, distractors="mirror-pair")
    questions += sample_questions(make_pools(pairs), "train", REQUESTS, Tally())
    angles = []
    for question in questions:
        views = [Rotation.from_matrix(turn) for turn in question.world_from_shape]
        told = question.angle_degrees
        for i, j in itertools.combinations(range(4), 2):
            turns = turns_between(question.shapes.cubes[i], question.shapes.cubes[j])
            if not turns:
                continue
            same = [views[j] * turn * views[i].inv() for turn in turns]
            angles.append(math.degrees(min(one.magnitude() for one in same)))
            assert angles[-1] >= least - 1e-9
            if (i, j) == (0, 1 + question.shapes.answer):
                assert told == pytest.approx(angles[-1], abs=1e-6)
    assert len(angles) >= 24, "the right answer of each, and the wrong ones of pairs"
    assert (min(angles) < 90) == (least < 90)


def test_answers_of_one_shape_or_its_mirror_image_are_related():
    spec = replace(SPEC, distractors="mirror-pair", cubes=(6, 6))
    drawn = draw_shapes(make_pools(spec), "val", [(0, 0)])[0]
    mirrored, related = relations([arrange(drawn, 1, RNG(0))])
    assert mirrored[0].tolist() == [[False, True, False], [True, False, True], [False, True, False]]
    assert (related[0] == ~np.eye(3, dtype=bool)).all()
    rod = np.arange(3)[:, None] * np.array([1, 0, 0])  # its own mirror image
    mirrored, related = relations([Shapes(np.stack([rod] * 4), None, 0)])
    assert not mirrored.any()
    assert (related[0] == ~np.eye(3, dtype=bool)).all()


def test_no_outline_is_shown_twice_in_a_question():
    """The three answers of a mirror pair, and the reference, are seen along four axes."""
    spec = replace(SPEC, distractors="mirror-pair", min_sight_angle_degrees=40)
    for question in sample_questions(make_pools(spec), "train", REQUESTS, Tally()):
        cubes, turns = question.shapes.cubes, question.world_from_shape
        for i, j in itertools.combinations(range(4), 2):
            hand = np.array([1, 1, 1])
            same = turns_between(cubes[i], cubes[j])
            if not same:
                hand = np.array([-1, 1, 1])
                same = turns_between(mirror(cubes[i]), cubes[j])
            axes = np.array([turn.apply(turns[i][2] * hand) for turn in same])
            assert np.abs(axes @ turns[j][2]).max() <= math.cos(math.radians(40)) + 1e-9


@pytest.mark.parametrize("constants", [{}, {"PROPOSALS_AT_ONCE": 1}, {"PROPOSALS_AT_ONCE": 5000}])
def test_neither_company_nor_order_nor_chunks_change_a_question(
    pools, sampled, constants, monkeypatch
):
    for name, value in constants.items():
        monkeypatch.setattr(module, name, value)
    expected = [bits(q) for q in sampled[0]]
    tally = Tally()
    for some in ([7, 6, 5], [0, 1, 2, 3, 4], [4]):
        again = sample_questions(pools, "val", [REQUESTS[i] for i in some], tally)
        assert [bits(q) for q in again] == [expected[i] for i in some]
    total = Tally()
    for request in REQUESTS:
        sample_questions(pools, "val", [request], total)
    assert total == sampled[1], "proposals are counted one by one, however many are judged at once"
    assert sample_questions(pools, "val", [], tally) == []


def test_kinds_with_one_seed_share_no_stream():
    kinds = [("mirror-pair", 3), ("mirror-pair", 2), ("mirror", 3), ("mixed", 3)]
    specs = [replace(SPEC, distractors=kind, answers=answers) for kind, answers in kinds]
    for purpose in (Purpose.QUESTION, Purpose.VIEW, Purpose.LIGHTS):
        draws = [question_rng(spec, "val", 3, purpose, 0).integers(2**62) for spec in specs]
        assert len(set(draws)) == len(specs)
    again = replace(SPEC, height=32, width=32, test=SPEC.test + 5)
    same = [question_rng(spec, "val", 3, Purpose.VIEW, 0).random() for spec in (SPEC, again)]
    assert same[0] == same[1], "the same questions in images of another size"


def is_proposed(question):
    """Which of the rotations that were drawn for each image are its own, up to the frame of its
    shape, (4, VIEWS)."""
    rng = question_rng(SPEC, "val", question.index, Purpose.VIEW, 0)
    turns = draw_rotations(rng, (6, module.VIEWS))[[question.shapes.answer, 3, 4, 5]]
    frames = np.swapaxes(question.world_from_shape, 1, 2)[:, None] @ turns
    return abs(frames - np.rint(frames)).max(axis=(2, 3)) < 1e-9


def test_views_are_the_first_good_ones_of_those_drawn(pools, sampled):
    """Which is what the tally counts: one accepted an image, and those before it refused."""
    questions, tally = sampled
    assert {q.attempt for q in questions} == {0}
    refused = 0
    for question in questions:
        same = is_proposed(question)
        assert (same.sum(axis=1) == 1).all()
        refused += int(same.argmax(axis=1).sum())
    assert tally.proposed == tally.refused + 4 * len(questions)
    assert tally.refused <= refused, "those too near to the reference's view do not count"
    free, every = replace(SPEC, min_angle_degrees=0, min_sight_angle_degrees=0), Tally()
    for question in sample_questions(replace(pools, spec=free), "val", REQUESTS, every):
        every.refused -= int(is_proposed(question).argmax(axis=1).sum())
    assert every.refused == 0
    assert every.proposed > 4 * len(REQUESTS)


def test_a_shape_that_no_view_shows_whole_makes_way_for_another(pools, monkeypatch):
    """With few proposals many are given up; then all of the question is drawn anew."""
    monkeypatch.setattr(module, "VIEWS", 4)
    tally = Tally()
    questions = sample_questions(pools, "test", REQUESTS, tally)
    assert {0, 1} <= {q.attempt for q in questions}
    assert tally.proposed > tally.refused > 0
    for question in questions:
        [(cubes, _)] = draw_shapes(pools, "test", [(question.index, question.attempt)])
        assert turns_between(question.shapes.cubes[0], cubes[0])
    alone = [sample_questions(pools, "test", [request], Tally())[0] for request in REQUESTS]
    assert [bits(q) for q in alone] == [bits(q) for q in questions]


def test_whether_crowded_shapes_are_asked_for_does_not_tell_which_is_right(monkeypatch):
    """Given three shapes, a question comes about or not whichever of them is right; where each
    answer needs but a view of its own, the right one is seen twice, and that tells."""
    spec = replace(SPEC, cubes=(12, 12), max_radius=3.5, distractors="near", min_angle_degrees=60)
    pools = make_pools(spec)
    monkeypatch.setattr(module, "VIEWS", 12)
    drawn = draw_shapes(pools, "val", [(i, 0) for i in range(24)])
    requests = [(i, 0, 0) for i in range(24)]

    def came_about():
        shown = []
        for right in range(3):
            order = [right, *(k for k in range(3) if k != right)]
            shapes = [
                Shapes(np.concatenate([cubes[[right]], cubes]), kinds[order], right)
                for cubes, kinds in drawn
            ]
            symmetric = shape_symmetries(shapes)
            distances = camera_distances(spec, shapes)
            turns = find_views(spec, "val", requests, shapes, distances, symmetric, Tally())
            shown.append(np.isfinite(turns).all(axis=(1, 2, 3)))
        return np.array(shown)

    monkeypatch.setattr(module, "CROWDED", 12)  # these have just so many
    fair = came_about()
    assert (fair == fair[0]).all()
    assert 0 < fair[0].sum() < 24
    monkeypatch.setattr(module, "CROWDED", 13)
    unfair = came_about()
    assert (unfair != unfair[0]).any()


def test_the_search_for_what_cannot_be_is_bounded(pools, monkeypatch):
    monkeypatch.setattr(module, "QUESTION_ATTEMPTS", 3)
    monkeypatch.setattr(module, "VIEWS", 5)
    monkeypatch.setattr(module, "MARGIN", 1000)
    tally = Tally()
    with refused(PlacementError, "test question 12"):
        sample_questions(pools, "test", [(9, 0, 0), (12, 2, 1)], tally)
    assert tally == Tally(20, 20), "5 views of two references each, before the third attempts"
    monkeypatch.setattr(module, "MARGIN", 0)
    with pytest.raises(PlacementError):
        sample_questions(pools, "test", [(9, 0, 3)], Tally())


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
