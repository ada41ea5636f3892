"""Which scenes and questions a report shows."""

import numpy as np
import pytest

from metrics.views.examples import chosen_questions, chosen_scenes


def test_scenes_stand_by_their_mean_with_the_view_nearest_to_it():
    scenes = np.repeat(np.arange(24), 3)
    values = np.repeat(np.arange(24.0), 3) + np.tile([-0.3, 0.1, 0.2], 24)
    chosen = chosen_scenes(scenes, values, higher_is_better=False)
    shown = {title: [entry // 3 for entry in entries] for title, entries in chosen.items()}
    assert shown == {
        "best": [0, 1, 2, 3, 4, 5],
        "median": [9, 10, 11, 12, 13, 14],
        "worst": [23, 22, 21, 20, 19, 18],
    }
    assert {entry % 3 for entries in chosen.values() for entry in entries} == {1}
    turned = chosen_scenes(scenes, values, higher_is_better=True)
    assert turned["best"] == chosen["worst"]


@pytest.mark.parametrize("count", range(1, 20))
def test_no_scene_stands_twice(count):
    values = np.random.default_rng(count).normal(size=count)
    values[: count // 4] = np.nan
    chosen = chosen_scenes(np.arange(count), values, True)
    entries = [entry for shown in chosen.values() for entry in shown]
    assert len(set(entries)) == len(entries)
    assert np.isfinite(values[entries]).all()
    finite = count - count // 4
    assert len(chosen) == min(3, finite)
    assert chosen_scenes(np.arange(3), np.full(3, np.nan), True) == {}


def test_questions_are_spread_over_the_file():
    right = np.arange(100) % 2 == 0
    chosen = chosen_questions(right)
    assert chosen["right"] == [0, 20, 40, 58, 78, 98]
    assert all(not right[i] for i in chosen["wrong"])
    assert chosen_questions(np.array([True])) == {"right": [0]}
