"""The empty room against rendered rooms, and cameras that see no plane."""

import numpy as np
import pytest

from metrics.measures.relief import empty_room
from scenegen.camera import Camera
from scenegen.rooms.reader import RoomsFile


def test_an_empty_room_is_the_truth_wherever_no_object_is(rooms_path):
    with RoomsFile(rooms_path) as rooms:
        for room in rooms:
            size = rooms.spec.height, rooms.spec.width
            depth, normal = empty_room(room.world_from_camera, room.fov_y_degrees, *size)
            wall = room.object_id == 0
            assert np.isfinite(depth).all()
            assert depth[wall] == pytest.approx(room.depth[wall], rel=1e-5)
            assert normal[wall] == pytest.approx(room.normal[wall], abs=1e-5)
            assert (depth[room.object_id > 0] > room.depth[room.object_id > 0] - 1e-4).all()


@pytest.mark.parametrize(
    ("position", "target"), [((-1.0, -1.0, -1.0), (0.0, 0.0, 0.1)), ((2.0, 2.0, 2.0), (9.0,) * 3)]
)
def test_a_camera_that_sees_no_plane_still_has_a_depth(position, target):
    """Behind the walls, or turned away; no file of ours has one, but a stranger's may."""
    depth, normal = empty_room(Camera(position, target, 40.0).world_from_camera, 40.0, 4, 6)
    assert depth.shape == (4, 6)
    assert (np.isfinite(depth) & (depth > 0.0)).all()
    assert np.isfinite(normal).all()
