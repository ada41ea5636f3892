"""The table of names against the docs; `measures/test_axioms` holds it against the functions."""

from pathlib import Path

import pytest
from refusals import refused

from metrics.scoring.metric_names import (
    ALL,
    HEADLINE,
    PRINTED,
    UnknownMetricError,
    in_order,
    markdown_table,
    metric,
)

DOCS = Path(__file__).parents[3] / "docs" / "scores.md"


def test_names_that_are_derived():
    aligned = metric("delta_1_after_scale_shift")
    assert aligned.higher_is_better
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
    anew = "put what `python -m metrics.scoring.metric_names` prints into docs/scores.md"
    assert f"\n\n{markdown_table()}\n\n" in DOCS.read_text(), anew
    assert all(row.count(" | ") == 5 for row in markdown_table().splitlines())


def test_no_number_is_better_than_depth_at_the_camera():
    for name, far, near in (("chamfer", 80.0, 4.0), ("mse_depth", 6400.0, 16.0)):
        assert metric(name).worst(80.0) == far
        assert metric(name).worst(2.0) == metric(name).worst() == near
    assert metric("iqtt_accuracy").worst(80.0) == 0.0
