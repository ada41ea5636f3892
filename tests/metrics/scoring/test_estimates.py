"""Skills of rooms: their bounds, whatever a submission does to its own floor."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from metrics.scoring.estimates import ROUNDING, Bootstrap, floor_column, pooled_estimates, skills
from metrics.scoring.metric_names import SKILLED

SCENES = 6


def columns(**given_columns):
    """Items of SCENES rows, of which each has its own scene; columns that are not given are 0.5."""
    items = {name: np.full(SCENES, 0.5) for name in SKILLED}
    items |= {
        begin + name: np.full(SCENES, 0.5) for name, begins in SKILLED.items() for begin in begins
    }
    return items | {name: np.asarray(column, np.float64) for name, column in given_columns.items()}


def skills_of(items):
    return skills(items, np.arange(SCENES), Bootstrap(0, 200))


SHARES = st.lists(st.floats(-1.0, 1.0), min_size=SCENES, max_size=SCENES)


@given(SHARES, SHARES)
@example([0.0] * 5 + [-1.6e-61], [0.0] * 6)
@example([0.0] * 6, [0.0, 0.0, 0.0, 1.0, 0.0, 1.0])
def test_a_relief_that_goes_against_other_scenes_wins_nothing(own, other):
    """A floor of -1 would lift a correlation of 0 to a skill of 0.5."""
    items = columns(relief_correlation=own, other_scene_relief_correlation=other)
    found = skills_of(items).get("relief_correlation")
    if found is None:
        assert np.mean(other) == 1.0
    else:
        assert found.value <= np.mean(own) + ROUNDING
        assert found.floor == pytest.approx(max(np.mean(other), 0.0), abs=1e-12)
        if found.low is None or found.high is None:
            assert max(other) == 1.0, "some resample has perfect scenes alone, and so no skill"
        else:
            assert found.low <= found.value <= found.high


def test_below_a_floor_of_0_the_floor_has_no_part_in_the_interval():
    own = np.linspace(-0.2, 0.6, SCENES)
    told = [
        skills_of(columns(relief_correlation=own, other_scene_relief_correlation=floor))
        for floor in (np.zeros(SCENES), np.linspace(-1.0, 0.5, SCENES))
    ]
    first, other = (one["relief_correlation"] for one in told)
    assert first == other
    assert first.value == pytest.approx(0.2)


def test_what_rounding_explains_is_0():
    floor = np.linspace(0.1, 0.3, SCENES)
    single = (floor.astype(np.float32) * np.float32(3)).astype(float) / 3
    for chamfer, is_floor in ((single, True), (floor * 0.999, False), (floor * 1.001, False)):
        found = skills_of(columns(chamfer=chamfer, empty_room_chamfer=floor))["chamfer"]
        assert found.is_floor is is_floor
        assert (found.value == 0.0) is is_floor


def test_rows_without_objects_leave_the_other_skills_as_they_were():
    """Skills that rest on other rows are resampled apart from them."""
    rng = np.random.default_rng(0)
    items = columns(chamfer=rng.random(SCENES))
    without = {name: np.where(np.arange(SCENES) < 2, np.nan, items[name]) for name in items}
    some = items | {name: c for name, c in without.items() if "relief" in name or "object" in name}
    whole, less = skills_of(items), skills_of(some)
    assert list(whole) == list(less) == list(SKILLED)
    assert less["chamfer"].low == pytest.approx(whole["chamfer"].low, abs=1e-12)


def test_the_floor_is_the_lowest_over_scenes_not_over_images():
    scene = np.array([0, 0, 0, 1])
    items = {
        "balls_behind_depth_error": np.array([0.1, 0.1, 0.1, 0.9]),
        "blocks_behind_depth_error": np.array([0.4, 0.4, 0.4, np.nan]),
    }
    name = "behind_depth_error"
    assert floor_column(items, scene, name, "first_view") == "blocks_behind_depth_error"


@pytest.mark.parametrize(
    ("name", "floors", "best"),
    [
        ("shape_error", {"cut_out_": 0.4, "empty_room_": 0.2}, "empty_room_"),  # as in interiors
        ("shape_error", {"cut_out_": 0.2, "empty_room_": 0.4}, "cut_out_"),
        ("shape_error", {"cut_out_": 0.3, "leaning_": 0.1, "empty_room_": 0.2}, "leaning_"),
        ("abs_rel", {"flat_": 0.2, "ramp_": 0.1}, "ramp_"),
        ("delta_1", {"flat_": 0.5, "ramp_": 0.7}, "ramp_"),  # higher is better
        ("delta_1", {"flat_": 0.5, "ramp_": 0.3}, "flat_"),
    ],
)
def test_the_floor_is_the_best_guess(name, floors, best):
    items = {begin + name: np.full(SCENES, value) for begin, value in floors.items()}
    assert floor_column(items, np.arange(SCENES), name) == best + name


def test_the_spread_of_runs_is_that_of_a_sample():
    runs = {"abs_rel": np.array([[0.1, 0.1], [0.3, 0.3]])}
    (score,) = pooled_estimates(runs, np.arange(2), np.ones(2), Bootstrap(0, 200)).values()
    assert (score.value, score.std) == (
        pytest.approx(0.2),
        pytest.approx(np.std([0.1, 0.3], ddof=1)),
    )


def test_another_seed_gives_another_interval():
    rng = np.random.default_rng(1)
    items = columns(chamfer=rng.random(SCENES), empty_room_chamfer=rng.random(SCENES))
    first, other = (
        skills(items, np.arange(SCENES), Bootstrap(seed, 200))["chamfer"] for seed in (0, 1)
    )
    assert first.value == other.value
    assert first.high != other.high
