"""Which scenes and questions a report shows."""

import numpy as np
import pytest

from metrics.measures.relief import empty_room
from metrics.prediction_writer import RoomPredictionWriter
from metrics.scoring.evaluate import open_runs, score
from metrics.views.examples import chosen_questions, chosen_scenes, examples_of
from scenegen.rooms.reader import RoomsFile


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


def test_the_best_scenes_are_not_those_in_which_nothing_is_predicted(truths, tmp_path):
    """Half of the scenes are noisy truth, half the empty room, whose errors may be less."""
    path = tmp_path / "p.h5"
    noise = np.random.default_rng(0)
    with (
        RoomsFile(truths.rooms) as rooms,
        RoomPredictionWriter(path, rooms.path, method="m") as out,
    ):
        empty = {int(scene) for scene in np.unique(rooms.read("scene_index", slice(None)))[::2]}
        for row, room in enumerate(rooms):
            depth = room.depth + noise.normal(0, 0.05, room.depth.shape)
            if room.scene.index in empty:
                depth, _ = empty_room(room.world_from_camera, room.fov_y_degrees, *depth.shape)
            out.add(row, depth=np.nan_to_num(depth, nan=1.0))
    with open_runs([path], truths.rooms) as runs:
        lists = examples_of(score([path], truths.rooms), runs.truth, runs.files[0])
    by_place = {title.split()[0]: examples for title, examples in lists}
    assert all("Relief correlation" in title for title, _ in lists)
    shown = {int(example.name.split()[1].strip(",")) for example in by_place["Best"]}
    assert not shown & empty
    worst = {int(example.name.split()[1].strip(",")) for example in by_place["Worst"]}
    assert worst <= empty
