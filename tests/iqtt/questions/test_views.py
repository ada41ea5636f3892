"""Questions as they are sampled: every cube shows, far enough from the reference; the search."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from polycubes import turns_between
from refusals import refused
from scipy.spatial.transform import Rotation

from iqtt.questions import views as module
from iqtt.questions.distractors import Shapes, arrange, draw_shapes, make_pools, question_rng
from iqtt.questions.specs import SplitSpec
from iqtt.questions.views import (
    Tally,
    camera_distances,
    draw_rotations,
    find_views,
    relations,
    sample_questions,
    shape_symmetries,
)
from iqtt.shapes.polycube import mirror
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


def radius(cubes):
    """The largest distance from the middle of the box to any corner of a cube."""
    corners = np.concatenate([cubes + offset for offset in itertools.product((0, 1), repeat=3)])
    return float(
        np.linalg.norm(corners - (corners.min(axis=0) + corners.max(axis=0)) / 2, axis=1).max()
    )


def spec_distance(radius):
    """Where a sphere's outline is the image's inscribed circle, and a pixel of 64 on each side."""
    return 64 / 62 * radius / math.sin(math.radians(SPEC.fov_degrees / 2))


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


def test_questions_are_what_was_asked_for(sampled):
    questions, _ = sampled
    for question, (index, place, attempt) in zip(questions, REQUESTS, strict=True):
        assert (question.index, question.shapes.answer) == (index, place)
        assert question.shapes.kinds[place] == -1
        assert question.attempt >= attempt
        assert turns_between(question.shapes.cubes[0], question.shapes.cubes[1 + place])
        assert question.camera_distance == pytest.approx(
            spec_distance(max(map(radius, question.shapes.cubes[1:])))
        )
        assert ((question.light_count >= 1) & (question.light_count <= 3)).all()
    assert len({bits(q) for q in questions}) == len(questions)


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
