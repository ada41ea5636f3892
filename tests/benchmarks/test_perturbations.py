"""Ways to spoil the truth: none at strength 0, and each what its name says."""

import numpy as np
import pytest

from benchmarks.results.perturbations import WAYS, draw, scores_of
from scenegen.rooms.reader import RoomsFile


@pytest.fixture
def rooms(make_rooms, tmp_path):
    with RoomsFile(make_rooms(tmp_path / "rooms.h5", 2, views=(0.0, 80.0))) as file:
        yield file


@pytest.mark.parametrize("name", [name for name in WAYS if name != "objects moved"])
def test_no_strength_is_the_truth(name, rooms):
    spoil, strengths = WAYS[name]
    room = rooms[0]
    known = np.isfinite(room.depth)
    assert spoil(room, 0.0)[known] == pytest.approx(room.depth[known], abs=1e-6)
    assert np.abs(spoil(room, strengths[1]) - room.depth)[known].max() > 1e-3


def test_what_is_moved_flattened_or_removed(rooms):
    room = rooms[0]
    objects = room.object_id > 0
    flat = WAYS["objects flat"][0](room, 1.0)
    number = room.object_id[objects][0]
    assert len(np.unique(flat[room.object_id == number])) == 1
    assert (flat[~objects] == room.depth[~objects]).all()
    gone = WAYS["objects removed"][0](room, 9.0)
    assert (gone[objects] > room.depth[objects]).all()
    moved = WAYS["objects moved"][0](room, 3.0)
    raised = gone - moved > 0.01
    assert np.array_equal(np.roll(gone - room.depth > 0.01, 3, axis=1), raised)


def test_the_picture_is_drawn(rooms, tmp_path):
    truth = scores_of(rooms, lambda room: room.depth)
    draw({"nothing": (truth, truth)}, truth, tmp_path / "p.svg")
    text = (tmp_path / "p.svg").read_text()
    assert "shape_error" in text
    assert "behind_depth_error" in text
