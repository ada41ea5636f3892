"""The table of names against the functions that make the scores, and against the docs."""

import re
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from refusals import refused
from scipy.spatial import cKDTree

from metrics.measures.alignment import Alignment
from metrics.measures.behind import behind_scores
from metrics.measures.boundaries import boundary_scores
from metrics.measures.depth import compare_depth, depth_scores
from metrics.measures.objects import object_means, single_objects
from metrics.measures.relief import relief_scores
from metrics.measures.shape import shape_scores
from metrics.measures.surfaces.chamfer_hausdorff import NearestDistances, paper_scores, point_scores
from metrics.measures.surfaces.normals import normal_scores
from metrics.measures.surfaces.points import local_point_scores, point_map_scores
from metrics.scoring.metric_names import (
    ALL,
    BASELINES,
    HEADLINE,
    PRINTED,
    SKILLED,
    TABLE,
    UnknownMetricError,
    in_order,
    markdown_table,
    metric,
)

DOCS = Path(__file__).parents[3] / "docs" / "scores.md"
ALIGNMENTS = get_args(Alignment)


def all_scores(noise):
    """Every score that the plain functions make, for a prediction this far off."""
    rng = np.random.default_rng(0)
    true = rng.uniform(0.2, 3.0, (8, 8))
    wrong = true * (1.0 + noise * rng.standard_normal((8, 8)))
    points, moved = rng.random((50, 3)), rng.random((50, 3)) * noise
    forward = cKDTree(points).query(points + moved)[0]
    reverse = cKDTree(points + moved).query(points)[0]
    found = point_scores(NearestDistances(forward, reverse), (0.01, 0.05, 0.1))
    for alignment in ALIGNMENTS:
        found |= depth_scores(compare_depth(wrong, true), alignment)
    normals = normal_scores(50.0 * noise * rng.random(200))
    ids, relief = rng.integers(0, 3, 200), rng.random(200)
    objects = object_means(single_objects(ids, noise * relief, noise * relief))
    angle = normals["normal_mean_degrees"]
    objects |= {f"{way}object_normal_mean_degrees": angle for way in ("", "derived_")}
    inside = rng.integers(1, 3, 200)
    cloud = rng.random((200, 3)) + 1.0
    said = cloud + noise * rng.standard_normal((200, 3))
    found |= paper_scores(NearestDistances(forward, reverse))
    found |= shape_scores(said - cloud, said, cloud, inside)
    found |= behind_scores(noise * relief, noise * relief)
    jumps = np.cumsum([[1.0, 2.0] * 4] * 8, axis=0) % 3.1 + 0.5  # in all directions
    found |= boundary_scores(jumps + (wrong - true), jumps, np.ones_like(true, bool))
    found |= point_map_scores(said, cloud) | local_point_scores(said, cloud, inside)
    for alignment in ("scale", "scale_shift"):
        found |= point_map_scores(said, cloud, alignment)
    objects |= {f"{way}shape_normal_degrees": angle for way in ("", "derived_")}
    found |= {"fov_error_degrees": 9.0 * noise}
    found |= relief_scores(relief + 9.0 * noise * rng.standard_normal(200), relief) | objects
    return found | normals | {f"derived_{name}": value for name, value in normals.items()}


def test_every_score_that_is_made_is_in_the_table_and_none_beside():
    made = set(all_scores(0.2))
    thresholds = {name for name in made if name.startswith("f_score_")}
    assert len(thresholds) == 3
    floors = {begin + name for name, begins in SKILLED.items() for begin in begins}
    others = {"f_score_<threshold>", "iqtt_accuracy"}
    assert (made - thresholds) | floors | others == set(ALL)


def test_directions_and_limits_hold_for_scores_that_are_made():
    good, bad = all_scores(0.0), all_scores(1.0)
    for name, value in good.items():
        known = metric(name)
        assert "rooms" in known.tasks
        if known.higher_is_better:
            assert value == pytest.approx(known.largest, abs=1e-12)
            assert known.largest == 1.0 > bad[name] >= known.smallest
            assert known.unit == ("fraction" if known.smallest == 0.0 else "correlation")
        else:
            assert 0.0 <= value < 1e-12 < bad[name] <= known.largest


def test_names_that_are_derived():
    assert metric("f_score_0.05").title == "F-score at 0.05"
    aligned = metric("delta_1_after_scale_shift")
    assert aligned.higher_is_better
    assert aligned.definition.startswith("`delta_1`: the same after the scale, at least 0, and")
    assert metric("derived_normal_within_30").higher_is_better
    assert metric("iqtt_accuracy").tasks == ("iqtt",)
    tasks = {name: metric(name).tasks for name in ("normal_mean_degrees", "flat_rmse", "silog")}
    assert tasks == {
        "normal_mean_degrees": ("rooms", "measured"), "flat_rmse": ("measured",),
        "silog": ("rooms", "measured"),
    }  # fmt: skip
    derived = metric("derived_normal_mean_degrees")
    assert (derived.tasks, derived.of, derived.lacking) == (("rooms",), "points", "planes")
    assert (derived.redefined, metric("empty_room_chamfer").redefined) == (True, False)
    for task, names in (*HEADLINE.items(), *PRINTED.items()):
        assert all(task in metric(name).tasks for name in names)
    behind = metric("behind_depth_error")
    shown = {s: behind.baselines_shown(s) for s in ("no_view", "first_view", "scored_view")}
    assert shown == {
        "no_view": ["empty_room_"],
        "first_view": ["empty_room_", "balls_", "blocks_"],
        "scored_view": ["empty_room_", "cut_out_", "leaning_", "balls_", "blocks_"],
    }
    assert metric("shape_error").baselines_shown("no_view")[0] == "cut_out_"


THRESHOLDS = "<threshold>", "", "0", "0.050", "5e-2", "-1", "1.2.3", "1e999", "٣"
OTHERS = "", "Chamfer", "chamfer ", "chamfer_after_scale", "delta_4", "derived_chamfer"


@pytest.mark.parametrize("name", [*OTHERS, *(f"f_score_{threshold}" for threshold in THRESHOLDS)])
def test_other_names_are_unknown(name):
    with refused(UnknownMetricError, found=repr(name)):
        metric(name)


def test_the_order_is_that_of_the_table():
    expected = ["chamfer", "f_score_0.05", "f_score_0.1", "mse_depth", "iqtt_accuracy", "a", "z"]
    assert in_order(reversed(expected)) == expected
    known = [name for name in ALL if "<" not in name]
    assert in_order(reversed(known)) == known


def test_the_docs_hold_the_table():
    anew = "put what `python -m metrics.scoring.metric_names` prints into docs/scores.md"
    assert f"\n\n{markdown_table()}\n\n" in DOCS.read_text(), anew
    assert all(row.count(" | ") == 5 for row in markdown_table().splitlines())


def test_no_number_is_better_than_depth_at_the_camera():
    for name, far, near in (("chamfer", 80.0, 4.0), ("mse_depth", 6400.0, 16.0)):
        assert metric(name).worst(80.0) == far
        assert metric(name).worst(2.0) == metric(name).worst() == near
    assert metric("iqtt_accuracy").worst(80.0) == 0.0


def test_every_metric_has_its_formula_on_the_page_of_definitions():
    page = (DOCS.parent / "definitions.md").read_text()
    families = {m.name: re.sub(r"([\d.]+|<threshold>)$", "", m.name) for m in TABLE}
    formulas = [{name, f"{family}<x>", f"{family}k"} for name, family in families.items()]
    assert [names for names in formulas if not any(name in page for name in names)] == []
    of_rooms = BASELINES.keys() - {"flat_", "ramp_"}
    assert [begins for begins in of_rooms if begins not in page] == []
