"""The table of names against the docs; `measures/test_axioms` holds it against the functions."""

import csv
from pathlib import Path

import pytest
from refusals import refused

from metrics.scoring.metric_names import (
    ALL,
    HEADLINE,
    PRINTED,
    UnknownMetricError,
    csv_table,
    in_order,
    metric,
)

DOCS = Path(__file__).parents[3] / "docs" / "data" / "metrics.csv"


def test_names_that_are_derived():
    aligned = metric("delta_1_after_scale_shift")
    assert aligned.higher_is_better
    assert metric("derived_normal_within_30").higher_is_better
    assert metric("iqtt_accuracy").tasks == ("iqtt",)
    tasks = {name: metric(name).tasks for name in ("normal_mean_degrees", "flat_rmse", "silog")}
    assert tasks == {
        "normal_mean_degrees": ("rooms", "measured"), "flat_rmse": ("rooms", "measured"),
        "silog": ("rooms", "measured"),
    }  # fmt: skip
    derived = metric("derived_normal_mean_degrees")
    assert (derived.tasks, derived.of, derived.lacking) == (("rooms",), "points", "planes")
    assert (derived.redefined, metric("empty_room_chamfer").redefined) == (True, False)
    for kind, names in (*HEADLINE.items(), *PRINTED.items()):
        task = "rooms" if kind in ("interiors", "layers") else kind
        assert all(task in metric(name).tasks for name in names)
    behind = metric("behind_depth_error")
    assert behind.baselines_shown("no_view") == ["empty_room_"]
    assert behind.baselines_shown("first_view") == ["empty_room_", "balls_", "blocks_"]
    assert behind.baselines_shown("scored_view")[1:3] == ["cut_out_", "leaning_"]
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
    anew = "python -m metrics.scoring.metric_names > docs/data/metrics.csv"
    assert DOCS.read_text() == csv_table(), anew
    assert {len(row) for row in csv.reader(csv_table().splitlines())} == {6}


def test_no_number_is_better_than_depth_at_the_camera():
    for name, far, near in (("chamfer", 80.0, 4.0), ("mse_depth", 6400.0, 16.0)):
        assert metric(name).worst(80.0) == far
        assert metric(name).worst(2.0) == metric(name).worst() == near
    assert metric("iqtt_accuracy").worst(80.0) == 0.0
