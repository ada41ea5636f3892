"""Axioms of the measures: `over` runs each of them over all measures that must keep it.

A measure here takes predicted and true planar depth, (H, W) each, and returns scores by name. What
it takes else follows from these: points, normals, relief before a flat room, one object.
"""

import itertools
from collections.abc import Callable
from functools import partial
from typing import Any, get_args

import numpy as np
import pytest

from metrics.measures.alignment import Alignment, align, align_points
from metrics.measures.boundaries import boundary_scores
from metrics.measures.depth import compare_depth, depth_scores
from metrics.measures.objects import object_means, single_objects
from metrics.measures.relief import relief_scores
from metrics.measures.shape import inside_objects, shape_scores
from metrics.measures.surfaces.chamfer_hausdorff import f_score, nearest_distances, point_scores
from metrics.measures.surfaces.normals import (
    angular_errors_degrees,
    normal_scores,
    normals_from_depth,
)
from metrics.measures.surfaces.patches import surface_distances, surface_of
from metrics.measures.surfaces.points import departures, local_point_scores, point_map_scores
from metrics.scoring.metric_names import metric
from scenegen.camera import back_project, pixel_directions

Array = np.ndarray[Any, Any]
SIZE, FOV = 12, 40.0
BALL = np.hypot(*(np.mgrid[:SIZE, :SIZE] - SIZE / 2 + 0.5)) < 4.6
WHOLE = np.ones((SIZE, SIZE), bool)
RAYS = pixel_directions(SIZE, SIZE, FOV)


def points(depth):
    return back_project(depth, FOV).reshape(-1, 3)


def depth(p, t, alignment="none"):
    return depth_scores(compare_depth(p, t), alignment)


def clouds(p, t):
    return point_scores(nearest_distances(points(p), points(t)))


def near(p, t):
    return {"f_score_0.06": f_score(nearest_distances(points(p), points(t)), 0.06)}


def normals(p, t):
    both = (normals_from_depth(d, FOV)[0] for d in (p, t))
    return normal_scores(angular_errors_degrees(*both))


def surfaces(p, t):
    both = [
        surface_of(points(d), normals_from_depth(d, FOV)[0].reshape(-1, 3), FOV, WHOLE)
        for d in (p, t)
    ]
    nearest = nearest_distances(points(p), points(t))
    return point_scores(surface_distances(both[0], both[1], nearest, True))


def maps(p, t, alignment="none"):
    return point_map_scores(points(p), points(t), alignment)


def objects(p, t):
    nearest = nearest_distances(points(p), points(t)).reverse
    scores = object_means(single_objects(BALL.ravel(), np.abs(p - t).ravel(), nearest))
    return {name: scores[name] for name in ("object_depth_error", "object_completeness")}


def shape(p, t):
    at = inside_objects(BALL.astype(int)) > 0
    said, true = back_project(p, FOV)[at], back_project(t, FOV)[at]
    apart = departures(said, t[at], RAYS[at], True)
    scores = shape_scores(apart, said, true, at[at])
    return {name: value for name, value in scores.items() if "recall" not in name}


def relief(p, t):
    room = 1.1 * t.max()
    return relief_scores((room - p).ravel(), (room - t).ravel())


MEASURES: dict[str, Callable[[Array, Array], dict[str, float]]] = {
    **{f"depth {a}": partial(depth, alignment=a) for a in get_args(Alignment)},
    **{f"maps {a}": partial(maps, alignment=a) for a in ("none", "scale", "scale_shift")},
    "local maps": lambda p, t: local_point_scores(points(p), points(t), BALL.ravel().astype(int)),
    "boundaries": lambda p, t: boundary_scores(p, t, WHOLE),
    **{f.__name__: f for f in (clouds, near, surfaces, normals, objects, shape, relief)},
}
DEPTH, MAPS = ([name for name in MEASURES if name.startswith(f"{x} ")] for x in ("depth", "maps"))
POWER = {"scene unit": 1, "scene unit squared": 2, "1 / scene unit": -1}
SIDES = {
    "hausdorff_forward": "hausdorff_reverse",
    "hausdorff_reverse": "hausdorff_forward",
    "accuracy_distance": "completeness_distance",
    "completeness_distance": "accuracy_distance",
}


def over(*names):
    """Run an axiom over measures, all without names, with a random truth and prediction."""

    def each(axiom):
        @pytest.mark.parametrize("seed", [0, 1])
        @pytest.mark.parametrize("name", names or MEASURES)
        def run(name, seed):
            rng = np.random.default_rng(seed)
            y, x = np.mgrid[:SIZE, :SIZE] / SIZE
            bend = np.sqrt(np.maximum(22.0 - np.hypot(12 * y - 5.5, 12 * x - 5.5) ** 2, 0.0)) / 9
            true = 3.0 + 0.4 * x - 0.3 * y * x - bend
            said = 1.02 * true + 0.05 * np.sin(7.0 * y + seed) + 0.02 * rng.random(true.shape)
            axiom(MEASURES[name], said, true)

        return run

    return each


def same(found, expected, tolerance=1e-07):
    assert found == {k: pytest.approx(v, rel=tolerance, abs=tolerance) for k, v in expected.items()}


def worse(name, a, b):
    return a < b if metric(name).higher_is_better else a > b


@over()
def test_identity(scores, said, true):
    """The truth is perfect, and nothing else is."""
    perfect, other = scores(true, true), scores(said, true)
    for name, value in perfect.items():
        if name != "boundary_f1":  # which counts directions that have no boundary
            best = float(metric(name).higher_is_better)
            assert value == pytest.approx(best, abs=2e-6), name
        assert not worse(name, value, other[name]), name
        assert metric(name).smallest <= other[name] <= metric(name).largest, name
    assert any(worse(name, other[name], perfect[name]) for name in perfect)


@over()
def test_mirror(scores, said, true):
    """Pictures have no preferred side: left and right, top and bottom, rows and columns."""
    for turned in (np.fliplr, np.flipud, np.transpose):
        same(scores(turned(said), turned(true)), scores(said, true))


@over(*DEPTH, "relief")
def test_permutation(scores, said, true):
    """Pixels have no neighbours here."""
    order = np.random.default_rng(2).permutation(SIZE)
    same(scores(said[order], true[order]), scores(said, true))


@over(*(name for name in MEASURES if name not in ("near", "relief", "shape")))
def test_scale(scores, said, true):
    """In another unit of length, a score changes as its own unit says."""
    for factor in (0.125, 3.0):
        expected = {
            name: value * factor ** POWER.get(metric(name).unit, 0)
            for name, value in scores(said, true).items()
        }
        same(scores(factor * said, factor * true), expected)


@over()
def test_monotone(scores, said, true):
    """A prediction on the way to the truth is no worse than where it comes from."""
    steps = [scores(true + share * (said - true), true) for share in (1.0, 0.6, 0.2)]
    for first, second in itertools.pairwise(steps):
        assert [name for name in first if worse(name, second[name], first[name])] == []


@over("depth none", "maps none", "clouds", "near", "surfaces", "normals")
def test_exchange(scores, said, true):
    """Distances are symmetric, and what is one way is the other way then."""
    for p in (said, 0.79 * true):
        forth, back = scores(p, true), scores(true, p)
        for name, value in forth.items():
            if "rel" not in name:  # relative to the truth
                other = back[SIDES.get(name, name)]
                assert value == pytest.approx(other, rel=1e-7, abs=1e-7), name


@over(*DEPTH[1:], *MAPS[1:], "local maps")
def test_alignment(scores, said, true):
    """What an alignment leaves open has no part in the score."""
    name = next(name for name, measure in MEASURES.items() if measure is scores)
    expected = scores(said, true)
    for factor in (1e-200, 7.0, 1e90):
        same(scores(factor * said, true), expected, 1e-6)
    if name in ("depth scale_shift", "depth scale_shift_l1"):
        same(scores(7.0 * said - 2.0, true), expected, 1e-6)


@pytest.mark.parametrize("alignment", get_args(Alignment)[1:])
def test_near_and_far_are_never_swapped(alignment):
    """Depth that falls where the truth rises is worth a constant."""
    true = np.linspace(1.0, 3.0, 9)
    for said in (-true, 1.0 / true) if alignment.startswith("scale_shift") else (-true,):
        assert np.ptp(align(said, true, alignment)) == pytest.approx(0.0, abs=1e-12)
    if alignment in ("scale", "scale_shift"):
        cloud = np.outer(true, [0.1, 0.2, -1.0])
        assert np.ptp(align_points(-cloud, cloud, alignment), axis=0).max() < 1e-12
