"""Methods that leave different things open are compared under one alignment."""

import numpy as np
import pytest
from made_scores import rooms_scores
from refusals import refused

from metrics.scoring.aligned import AlignmentError, aligned, common_alignment
from metrics.views.compare.compare import compare
from metrics.views.compare.pairing import ComparisonError
from metrics.views.leaderboard import LeaderboardError, rankings

SCENES = np.arange(8)
RNG = np.random.default_rng(0)


def method(name, alignment, plain, fitted, after, **other):
    """A method with `abs_rel` as scored, and after an alignment."""
    noise = 0.001 * RNG.random(8)
    columns = {"abs_rel": plain + noise, f"abs_rel_after_{after}": fitted + noise}
    columns |= {"ordinal_accuracy": 0.9 - noise, "boundary_f1": 0.5 - noise, "chamfer": noise}
    columns |= {"empty_room_abs_rel": np.full(8, 0.5), "scale_log2": noise}
    file = rooms_scores(name, columns, SCENES, alignment=alignment, **other)
    vars(file)["length"] = "metre"
    return file


# As measured: metric depth, and depth up to scale and shift that is worse after the same fit.
METRIC = method("metric", "none", 0.129, 0.0733, "scale_shift")
AFFINE = method("affine", "scale_shift", 0.0741, 0.0741, "scale_shift")


def test_the_fit_itself_wins_nothing():
    for metrics in (None, ["abs_rel"]):
        comparison = compare([METRIC, AFFINE], metrics)
        (difference,) = (d for d in comparison.differences if d.metric == "abs_rel")
        assert (comparison.alignment, difference.verdict) == ("scale_shift", "worse")
        assert difference.reference_value == pytest.approx(0.0733, abs=1e-3)
    (ranking,) = rankings([AFFINE, METRIC], ["abs_rel"])
    assert [file.method for file in ranking.files] == ["metric", "affine"]
    assert {file.skills["abs_rel"].floor for file in ranking.files} == {0.5}
    assert ranking.ranks == ("1", "2")


def test_what_a_fit_changes_is_left_out():
    metric, affine = aligned([METRIC, AFFINE])
    assert metric.declared == "none"
    assert affine is AFFINE
    assert {"abs_rel", "ordinal_accuracy"} <= metric.items.keys()
    assert not {"boundary_f1", "chamfer", "scale_log2"} & metric.items.keys()
    scaled = method("scaled", "scale", 0.08, 0.08, "scale")
    other = method("other", "none", 0.1, 0.07, "scale")
    assert {"boundary_f1", "ordinal_accuracy"} <= aligned([scaled, other])[1].items.keys()
    assert "chamfer" not in aligned([scaled, other])[1].items
    with refused(ComparisonError):
        compare([METRIC, AFFINE], ["chamfer"])
    assert any("boundary_f1" in note for note in compare([AFFINE, METRIC]).notes)


@pytest.mark.parametrize(
    ("declared", "chosen", "found"),
    [
        (("none", "none"), None, "none"),
        (("none", "scale"), None, "scale"),
        (("median_scale", "scale"), None, "scale"),
        (("median_scale", "none"), None, "median_scale"),
        (("scale", "disparity_scale_shift"), None, "disparity_scale_shift"),
        (("none", "none"), "scale_shift", "scale_shift"),
        (("scale", "none"), "scale_l1", "scale_l1"),
        (("scale_shift", "disparity_scale_shift"), None, None),
        (("scale_shift", "none"), "scale", None),
    ],
)
def test_the_loosest_alignment_is_common(declared, chosen, found):
    files = [(name, name) for name in declared]
    if found is None:
        with refused(AlignmentError):
            common_alignment(files, chosen)
    else:
        assert common_alignment(files, chosen) == found


def test_no_method_is_ranked_by_a_bias_or_without_an_image():
    with refused(ComparisonError):
        compare([METRIC, METRIC], ["scale_log2"])
    with refused(LeaderboardError):
        rankings([METRIC], ["scale_log2"])
    columns = {"behind_depth_error": RNG.random(16), "empty_room_behind_depth_error": np.ones(16)}
    scenes = np.repeat(SCENES, 2)
    for shown, ranks in (("first_view", ("1",)), ("no_view", ("",))):
        file = rooms_scores("blind", columns, scenes)
        vars(file)["shown"] = shown
        (ranking,) = rankings([file], ["behind_depth_error"])
        assert ranking.ranks == ranks
