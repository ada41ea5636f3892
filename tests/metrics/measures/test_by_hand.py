"""Edges of the measures, by hand, and guesses that must win nothing.

`scoring/test_definitions` has the formulas on whole files.
"""

from typing import get_args

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from metrics.measures.alignment import Alignment
from metrics.measures.answers import ABSTAINED, answers_from_scores
from metrics.measures.boundaries import RATIOS, boundary_scores
from metrics.measures.checks import EmptyError, MeasureError, NonFiniteError
from metrics.measures.depth import align, compare_depth, delta, depth_scores, silog
from metrics.measures.hidden.behind import MARGIN, behind_scores, hidden_from
from metrics.measures.hidden.guesses import balls_and_blocks
from metrics.measures.objects import LEAST_PIXELS, object_means, single_objects, size_range
from metrics.measures.relief import depth_along, empty_room, relief_scores
from metrics.measures.shape import flat_error, inside_objects, one_normal_degrees, shape_scores
from metrics.measures.skill import skill, skill_intervals
from metrics.measures.statistics import pooled_means
from metrics.measures.surfaces.chamfer_hausdorff import NearestDistances, f_score
from metrics.views.compare.paired_tests import (
    SIGN_FLIPS,
    holm,
    sign_flip_test,
    smallest_detectable_difference,
)
from scenegen.camera import Camera, back_project, pixel_directions, pixel_size
from scenegen.rooms.reader import RoomsFile

RNG = np.random.default_rng(5)


@pytest.mark.parametrize("ids", [[0] * 20, [], [5] * (LEAST_PIXELS - 1)])
def test_without_objects_there_is_no_score(ids):
    none = np.array(ids, np.int8)
    scores = single_objects(none, np.ones(len(none)), np.ones(len(none)))
    assert not any(map(len, scores.values()))
    assert len(object_means(scores)) == 4
    assert all(np.isnan(list(object_means(scores).values())))


def test_sizes_are_ranges_of_percent():
    shares = (0.0, 0.0099, 0.01, 0.05, 0.08, 1.0)
    assert list(map(size_range, shares)) == ["0-1", "0-1", "1-2", "4-8", "8-100", "8-100"]


@pytest.mark.parametrize(
    ("small", "inside"), [((6, 6), 16), ((5, 5), 0), ((6, 5), 0), ((7, 6), 20)]
)
def test_objects_with_16_pixels_inside_count(small, inside):
    ids = np.zeros((12, 12), np.int8)
    ids[2 : 2 + small[0], 2 : 2 + small[1]] = 1
    assert (inside_objects(ids) == 1).sum() == inside


def test_the_highest_score_is_the_answer_and_a_tie_is_none():
    scores = [[0.1, 0.7, 0.2], [3, 1, 2], [-5.0, -4.0, -3.0], [1, 1, 0], [0, 2, 2], [1, 1, 1]]
    assert answers_from_scores(scores).tolist() == [1, 0, 2, *[ABSTAINED] * 3]
    assert answers_from_scores([[0.2, 0.1], [0.0, 3.0], [1, 1]]).tolist() == [0, 1, ABSTAINED]
    for candidates in (1, 4):
        with pytest.raises(MeasureError):
            answers_from_scores(np.eye(4)[:, :candidates])


def test_boundaries_that_lack_a_direction_count_as_published():
    """One step, in one direction of four and at five ratios of ten: the truth itself has .21."""
    flat, whole = np.ones((6, 6)), np.ones((6, 6), bool)
    step = np.where(np.arange(6) < 3, 1.0, 1.1) * flat
    expected = 0.25 * RATIOS[RATIOS < 1.1].sum() / RATIOS.sum()
    for scale in (1.0, 7.0):
        scores = boundary_scores(scale * step, step, whole)
        assert scores == {"boundary_f1": pytest.approx(expected), "boundary_recall": 1.0}
    assert set(boundary_scores(flat, step, whole).values()) == {0.0}
    nothing = boundary_scores(step, flat, whole)
    assert nothing["boundary_f1"] == 0.0
    assert np.isnan(nothing["boundary_recall"])


def test_a_step_of_exactly_a_ratio_is_not_above_it():
    step = np.where(np.arange(6) < 3, 1.0, RATIOS[4]) * np.ones((6, 1))
    scores = boundary_scores(step, step, np.ones_like(step, bool))
    assert scores["boundary_f1"] == pytest.approx(0.25 * RATIOS[:4].sum() / RATIOS.sum())


def test_a_hole_in_the_mask_is_no_boundary():
    flat, mask = np.full((5, 5), 2.0), np.ones((5, 5), bool)
    mask[2, 2] = False
    scores = boundary_scores(flat, flat, mask)
    assert scores["boundary_f1"] == 0.0
    assert np.isnan(scores["boundary_recall"])


def test_recall_is_of_all_true_boundaries_and_needs_no_precision():
    """Noise adds boundaries of its own, and hides none."""
    true = np.where(np.arange(12) < 6, 1.0, 2.0) * np.ones((8, 1))
    said = true * RNG.choice([1.0, 1.3], true.shape, p=[0.7, 0.3])
    scores = boundary_scores(said, true, np.ones_like(true, bool))
    assert scores["boundary_recall"] == pytest.approx(np.mean(said[:, 6] / said[:, 5] > 1.25))
    assert scores["boundary_f1"] < 0.5 * scores["boundary_recall"]


def test_points_farther_than_the_margin_behind_a_wall_are_hidden():
    wall, toward = np.full((8, 8), 2.0), np.tile([0.0, 0.0, 1.0], (2, 1))
    points = np.array([[0.0, 0.0, -2.0 - 0.5 * MARGIN], [0.0, 0.0, -2.0 - 1.5 * MARGIN]])
    assert MARGIN == 0.01
    assert hidden_from(points, toward, wall, np.eye(4), 40.0).tolist() == [False, True]
    assert hidden_from(points, -toward, wall, np.eye(4), 40.0).tolist() == [True, True]
    aside = toward[:, [2, 0, 1]]  # edge-on from the middle of the picture
    assert hidden_from(points, aside, wall, np.eye(4), 40.0).tolist() == [True, True]
    wall[3, 3] = 3.0  # a neighbour through which the second is seen
    assert hidden_from(points, toward, wall, np.eye(4), 40.0).tolist() == [False, False]


def test_an_empty_room_is_the_truth_wherever_no_object_is(rooms_path):
    with RoomsFile(rooms_path) as rooms:
        for room in rooms:
            size = rooms.spec.height, rooms.spec.width
            depth, normal = empty_room(room.world_from_camera, room.fov_y_degrees, *size)
            wall = room.object_id == 0
            assert depth[wall] == pytest.approx(room.depth[wall], rel=1e-5)
            assert normal[wall] == pytest.approx(room.normal[wall], abs=1e-5)
            assert (depth[room.object_id > 0] > room.depth[room.object_id > 0] - 1e-4).all()


@pytest.mark.parametrize("toward", [-1.0, 1.0])
def test_normals_of_closed_rooms_face_the_camera(toward):
    """From the middle of a room of edge 2, along -z and +z."""
    camera = np.eye(4)
    camera[:3, :3] = np.diag([-toward, 1.0, -toward])
    camera[:3, 3] = 1.0
    depth, normal = empty_room(camera, 40.0, 1, 1, np.full(3, 2.0))
    assert depth.item() == pytest.approx(1.0)
    assert normal[0, 0] == pytest.approx([0.0, 0.0, 1.0])


def test_where_a_line_meets_no_plane_the_depth_is_the_farthest_of_others():
    camera = np.diag([-1.0, 1.0, -1.0, 1.0])  # looks along +z
    camera[:3, 3] = 1.0
    lines = np.array([[0.0, 0.0, -1.0], [0.0, -1.0, -1.0], [0.0, -0.5, -1.0]])
    assert depth_along(lines, camera).tolist() == [2.0, 1.0, 2.0]


@pytest.mark.parametrize(
    ("position", "target"),
    [
        ((-1.0, -1.0, -1.0), (0.0, 0.0, 0.1)),
        ((2.0,) * 3, (9.0,) * 3),
        ((-1.0, 1.0, 1.0), (-9.0, 1.1, 1.0)),
    ],
)
def test_a_camera_that_sees_no_plane_still_has_a_depth(position, target):
    """Behind the walls, or turned away; no file of ours has one, but a stranger's may."""
    depth, normal = empty_room(Camera(position, target, 40.0).world_from_camera, 40.0, 4, 6)
    assert (np.isfinite(depth) & (depth > 0.0)).all()
    assert np.isfinite(normal).all()


def test_a_correlation_never_exceeds_1():
    for seed in range(200):
        true = np.abs(np.random.default_rng(seed).normal(0.0, 0.3, 9)) + 0.1
        assert relief_scores(3.0 * true, true)["relief_correlation"] <= 1.0


@pytest.mark.parametrize(("forward", "reverse"), [([0.0], [0.5]), ([0.5], [0.0])])
def test_an_f_score_counts_strictly_nearer_points_both_ways(forward, reverse):
    assert f_score(NearestDistances(np.array(forward), np.array(reverse)), 0.5) == 0.0
    assert f_score(NearestDistances(np.array(forward), np.array(reverse)), 0.6) == 1.0


def test_a_root_mean_square_over_clusters_is_that_of_the_delta_method():
    means = pooled_means([1.0, 3.0], [0, 1], np.ones(2), True)
    assert means == pytest.approx(np.sqrt(5.0) + np.array([-1.0, 1.0]) * 2.0 / np.sqrt(5.0))
    assert pooled_means([1.0, 3.0], [0, 1], np.array([3.0, 1.0]), False).mean() == 1.5


def test_every_interval_of_a_skill_holds_the_skill():
    for seed in range(100):
        rng = np.random.default_rng(seed)
        scores, floors = rng.gamma(0.5, 1.0, (2, 9, 1))
        low, high = skill_intervals(scores, floors, seed, 100, confidence=0.2)
        assert low <= (floors.mean() - scores.mean()) / floors.mean() <= high


def test_a_guessed_ball_has_its_middle_two_thirds_of_its_radius_behind_what_is_seen():
    """So that its surface has the seen depth on average; it takes as many pixels as its object."""
    ids = (np.hypot(*(np.mgrid[:32, :32] - 15.5)) < 9).astype(int)
    balls, blocks = balls_and_blocks(np.full((32, 32), 2.0), ids, np.eye(4), 40.0)
    (x, y, z, radius) = balls[0]
    assert -z - 2.0 == pytest.approx(radius * 2.0 / 3.0)
    assert (x, y) == pytest.approx((0.0, 0.0), abs=1e-12)
    assert np.pi * radius**2 == pytest.approx(ids.sum() * (pixel_size(32, 40.0) * z) ** 2)
    width = 17 * pixel_size(32, 40.0) * 2.0  # between the outer pixels' centres
    assert np.ptp(blocks[0], axis=0)[[0, 2]] == pytest.approx([np.pi / 4.0 * width] * 2)


def test_paired_differences():
    """Of 40 equal ones, no random signs reach the sum; thresholds of Holm's method never fall."""
    assert sign_flip_test(np.ones(40), seed=0) == 1.0 / (1.0 + SIGN_FLIPS)
    assert holm([0.011, 0.01, 0.9]) == pytest.approx([0.03, 0.03, 0.9])
    assert holm([0.5, 0.4]) == pytest.approx([0.8, 0.8])
    # (z_.975 + z_.8) s / sqrt(2), where s is sqrt(2)
    assert smallest_detectable_difference([0.0, 2.0]) == pytest.approx(1.9599640 + 0.8416212)


ALIGNMENTS = get_args(Alignment)


def random_pair(seed):
    rng = np.random.default_rng(seed)
    true = rng.uniform(1.0, 3.0, (5, 6))
    return compare_depth(true * rng.uniform(0.5, 2.0) + 0.3 * rng.random((5, 6)), true)


def test_delta_limits_are_strict_and_symmetric():
    pair = compare_depth([1.25, 1.0, 1.24, 1.0, 1.5625, 1.9], [1.0, 1.25, 1.0, 1.24, 1.0, 1.0])
    assert [delta(pair, 1.25**power) for power in (1, 2, 3)] == [2 / 6, 4 / 6, 6 / 6]


@pytest.mark.parametrize("alignment", ALIGNMENTS)
@pytest.mark.parametrize("value", [0.0, -1.0, 0.1, 2.5, 1e-300, 1e-30, 1e30, 1e100])
def test_constants_have_finite_scores(alignment, value):
    true = np.linspace(1.0, 3.0, 50)
    pair = compare_depth(np.full(50, value), true)
    assert np.isfinite(list(depth_scores(pair, alignment).values())).all()
    if alignment == "scale_shift":
        assert align(pair, alignment).predicted == pytest.approx(np.full(50, 2.0))


@pytest.mark.parametrize("alignment", ["none", "median_scale", "scale"])
def test_a_lost_sign_scores_worse_than_its_positive_twin(alignment):
    true = np.linspace(1.0, 3.0, 50)
    name = "silog" if alignment == "none" else f"silog_after_{alignment}"
    for depth in (np.full(50, 1.5), true):
        good, bad = (depth_scores(compare_depth(s * depth, true), alignment)[name] for s in (1, -1))
        assert bad > 500.0 > 100.0 > good


def test_pixels_behind_the_camera_find_no_scale():
    """The others are aligned without them: half of the pixels at ln 1000 each from a truth of 1."""
    true = np.ones(4)
    expected = 100.0 * np.sqrt(np.log(1000.0) ** 2 / 2.0)
    for scale in (1.0, 7.0):
        pair = compare_depth([scale, scale, -scale, 1e-3], true)
        assert silog(pair) == pytest.approx(expected)


@given(st.integers(0, 2**32 - 1))
def test_silog_of_positive_depth_is_a_standard_deviation(seed):
    """To the bit, so that no score of depth in front of the camera has changed."""
    pair = random_pair(seed)
    assert silog(pair) == 100.0 * np.sqrt(np.var(np.log(pair.predicted) - np.log(pair.true)))


NOISE = np.random.default_rng(3)
RELIEF = np.maximum(NOISE.normal(0.0, 0.15, 4000), 0.0)
SPOT = np.where(np.arange(4000) == 9, 0.06, 0.0)  # an object of one pixel


@pytest.mark.parametrize("true", [SPOT, np.full(9, 0.3)], ids=["one", "all alike"])
def test_the_truth_is_perfect_and_the_empty_room_has_nothing(true):
    varied = float(np.ptp(true) > 0.0)
    assert relief_scores(true, true) == {
        "relief_correlation": pytest.approx(varied, abs=1e-12),
        "relief_iou": 1.0,
    }
    assert set(relief_scores(np.zeros_like(true), true).values()) == {0.0}


@given(st.floats(-2.0, 2.0), st.floats(1e-12, 1e-6), st.booleans())
def test_noise_and_a_constant_win_and_lose_nothing(lift, size, along):
    """Even noise that is the true relief itself, made too small to see."""
    noise = RELIEF if along else NOISE.normal(0.0, 1.0, 4000)
    found = relief_scores(lift + size * noise, RELIEF)["relief_correlation"]
    assert abs(found) <= 2e-3 if not along else 0.0 <= found <= 1e-3


def test_correlation_turns_with_the_sign_of_relief_and_never_overflows():
    turned = {"relief_correlation": pytest.approx(-1.0), "relief_iou": 0.0}
    assert relief_scores(-RELIEF, RELIEF) == turned
    largest = np.where(RELIEF > 0.1, 3e38, -3e38)
    assert 0.0 < relief_scores(largest, RELIEF)["relief_correlation"] <= 1.0


def test_where_nothing_stands_out_there_is_no_score():
    assert all(np.isnan(list(relief_scores(RELIEF, np.full(4000, 0.05)).values())))
    for error, arrays in (
        (EmptyError, ([], [])),
        (MeasureError, ([0.1], [0.1, 0.2])),
        (NonFiniteError, ([np.nan], [0.1])),
        (NonFiniteError, ([0.1], [np.inf])),
    ):
        with pytest.raises(error):
            relief_scores(*map(np.asarray, arrays))


SIZE, FOV = 48, 40.0


def ball(centre, radius):
    """Planar depth of a ball before a wall at depth 4, and which pixels show it."""
    rays = pixel_directions(SIZE, SIZE, FOV)
    a, b = (rays**2).sum(axis=-1), rays @ np.asarray(centre)
    root = b**2 - a * (np.dot(centre, centre) - radius**2)
    hit = root > 0.0
    return np.where(hit, (b - np.sqrt(np.maximum(root, 0.0))) / a, 4.0), hit


BALL, HIT = ball([0.1, 0.1, -2.5], 0.5)
IDS = np.where(HIT, 3, 0)
INSIDE = inside_objects(IDS)


def scores(depth):
    at = INSIDE > 0
    points, true = (back_project(d, FOV)[at] for d in (depth, BALL))
    return shape_scores((BALL - depth)[at][:, None], points, true, INSIDE[at])


def test_inside_is_the_mask_without_its_rim_of_objects_that_are_large_enough():
    by_hand = np.zeros_like(IDS)
    for i in range(1, SIZE - 1):
        for j in range(1, SIZE - 1):
            by_hand[i, j] = 3 * (IDS[i - 1 : i + 2, j - 1 : j + 2] == 3).all()
    assert np.array_equal(INSIDE, by_hand)


def test_a_slanted_plane_and_noise_have_no_correlation():
    rays = pixel_directions(SIZE, SIZE, FOV)
    plane = 2.0 / (1.0 + 0.4 * rays[..., 0] - 0.3 * rays[..., 1])
    assert scores(plane)["shape_correlation"] == pytest.approx(0.0, abs=1e-6)
    noise = 2.0 + 1e-7 * np.random.default_rng(0).normal(size=BALL.shape)
    assert abs(scores(noise)["shape_correlation"]) < 1e-3
    assert scores(5.0 - BALL)["shape_correlation"] < -0.9  # hollow


def test_flat_truth_has_no_correlation_and_no_object_has_no_score():
    at = INSIDE > 0
    true = back_project(np.full_like(BALL, 2.0), FOV)[at]
    none = np.zeros((len(true), 1))
    found = shape_scores(none, true, true, INSIDE[at])
    assert found["shape_error"] == 0.0
    assert np.isnan(found["shape_correlation"])
    assert np.isnan(list(shape_scores(none[:0], true[:0], true[:0], INSIDE[at][:0]).values())).all()
    assert np.isnan([flat_error(BALL[:0], IDS[:0]), one_normal_degrees(true[:0], IDS[:0])]).all()


DRAWS = np.random.default_rng(8)
FLOORS = DRAWS.gamma(2.0, 0.1, 60)


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
    scores = FLOORS * DRAWS.uniform(0.0, 1.9, 60)
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


def test_where_there_is_no_interval():
    assert np.isnan(skill_interval([0.1], [0.2], 0)).all()
    # Among three scenes of which one has objects, some resamples have none.
    assert np.isnan(skill_interval([0.1, 0.0, 0.0], [0.2, 0.0, 0.0], 0)).all()
    for scores, floors in (([0.1, 0.2], [0.0, 0.0]), ([0.1], [0.1, 0.2]), ([], [])):
        with pytest.raises(MeasureError):
            skill_interval(scores, floors, 0)


def test_scores_of_what_is_hidden():
    errors, nearest = np.linspace(0.0, 0.3, 16), np.repeat([0.01, 0.06], 8)
    assert behind_scores(errors, nearest) == {
        "behind_depth_error": pytest.approx(0.15),
        "behind_recall_0.05": 0.5,
    }
    assert np.isnan(list(behind_scores(errors[1:], nearest[1:]).values())).all()
