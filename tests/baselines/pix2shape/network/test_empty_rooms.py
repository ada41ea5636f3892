"""Against the baseline empty-room, which numpy computes from the file, and against the truth."""

import numpy as np
import torch

from baselines.pix2shape.network.empty_rooms import NEAREST, empty_rooms
from metrics.measures.relief import empty_room
from scenegen.rooms.reader import RoomsFile


def test_depth_is_that_of_the_baseline_and_objects_lie_behind_the_entry(turned_path):
    with RoomsFile(turned_path) as rooms:
        poses = rooms.read("camera/world_from_camera", slice(None))
        told = torch.tensor(poses, dtype=torch.float64)
        fov, side = rooms.spec.fov_y_degrees, rooms.spec.height
        depth, entry, points = empty_rooms(told, fov, side)
        for row in range(len(rooms)):
            expected, _ = empty_room(poses[row], fov, side, side)
            np.testing.assert_allclose(depth[row], expected, rtol=1e-6)
            truth = rooms.read("depth", row)
            room = rooms.read("object_id", row) == 0
            np.testing.assert_allclose(truth[room], depth[row].numpy()[room], rtol=1e-5)
            assert (truth > entry[row].numpy()).all()
    assert float(points.abs().amin(dim=1).max()) < 1e-9, "each point has a coordinate of 0"


def test_rays_enter_through_the_open_sides_of_the_box():
    pose = torch.eye(4, dtype=torch.float64)[None]
    pose[0, :3, 3] = torch.tensor([0.5, 0.5, 2.5])
    depth, entry, points = empty_rooms(pose, 20.0, 8)
    np.testing.assert_allclose(depth[0], 2.5, err_msg="the wall z = 0")
    np.testing.assert_allclose(entry[0], 1.5, err_msg="the open side z = 1")
    np.testing.assert_allclose(points[0, 2], 0, atol=1e-12)


def test_cameras_within_the_room_or_turned_away_give_depths_that_can_be_used():
    poses = torch.eye(4).repeat(2, 1, 1)
    poses[0, :3, 3] = 0.5
    poses[1, :3, :3] = torch.diag(torch.tensor([-1.0, 1.0, -1.0]))  # looks along +z
    poses[1, :3, 3] = torch.tensor([0.5, -0.5, 2.0])
    depth, entry, points = empty_rooms(poses, 40.0, 6)
    assert torch.isfinite(depth).all()
    assert torch.isfinite(points).all()
    assert (entry < depth).all()
    assert (entry[0] == NEAREST).all()
