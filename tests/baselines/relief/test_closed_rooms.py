"""Relief networks in closed rooms: their size is told, and lengths are in the room's edge."""

from dataclasses import replace

import h5py
import numpy as np
import pytest
import torch
from pix2shape_models import in_memory
from refusals import refused

from baselines.pix2shape.network.empty_rooms import Cameras, empty_rooms, planes_of
from baselines.relief import depth_supervised, view_pairs
from baselines.relief.depth_completed import Completion
from baselines.relief.network import Card, Settings, predicted_depth, relief_network
from baselines.relief.training import cameras_of
from baselines.training.baseline import train, write_submission
from baselines.training.data import TrainingFiles
from baselines.training.rooms import camera_poses
from metrics.measures.relief import empty_room
from scenegen.common.errors import SpecError
from scenegen.rooms.reader import RoomsFile

SMALL = Settings(size=32, width=0.1, iterations=2, batch=2)


@pytest.fixture(scope="module")
def cameras(interior_path) -> Cameras:
    return cameras_of(in_memory(interior_path, 32), torch.tensor([0]))


def told(cameras: Cameras) -> tuple[torch.Tensor, ...]:
    pose, fov, size = cameras.world_from_camera, cameras.fov_y_degrees, cameras.room_size
    return empty_rooms(pose, fov, 32, size)


def test_rays_end_at_six_walls_and_objects_lie_behind_the_entry(cameras, interior_path):
    depth, entry, _ = told(cameras)
    with RoomsFile(interior_path) as rooms:
        fov = float(rooms.read("camera/fov_y_degrees", 0))
        pose = rooms.read("camera/world_from_camera", 0)
        expected, _ = empty_room(pose, fov, 32, 32, rooms.room_size(0))
        truth = rooms.read("depth", 0)
        shown = rooms.read("object_id", 0) > 0
    np.testing.assert_allclose(depth[0], expected, rtol=1e-4)
    assert (truth[shown] > entry[0].numpy()[shown]).all()


def test_a_room_twice_as_large_looks_the_same_and_is_twice_as_deep(cameras):
    pose = cameras.world_from_camera.clone()
    pose[:, :3, 3] *= 2
    larger = replace(cameras, world_from_camera=pose, room_size=2 * cameras.room_size)
    torch.testing.assert_close(planes_of(larger, 32), planes_of(cameras, 32), rtol=1e-4, atol=1e-4)
    torch.manual_seed(0)
    network, image = relief_network(Card("x", SMALL)).eval(), torch.rand(1, 3, 32, 32)
    with torch.no_grad():
        network.last.bias.fill_(0.1)
        one, two = (predicted_depth(network, image, c, c) for c in (cameras, larger))
    torch.testing.assert_close(two, 2 * one, rtol=1e-3, atol=1e-3)
    assert (one < told(cameras)[0] - 0.02).any()


def test_one_network_learns_both_kinds_of_rooms_and_predicts_both(
    interior_path, turned_path, tmp_path
):
    with TrainingFiles(interior_path, turned_path) as data:
        weights = train(depth_supervised.BASELINE, data, tmp_path, SMALL)
    for path in (interior_path, turned_path):
        write_submission(
            depth_supervised.BASELINE, path, tmp_path / "x.h5", weights, overwrite=True
        )
        with h5py.File(tmp_path / "x.h5") as file:
            assert np.isfinite(file["depth"][()]).all()


def test_methods_of_the_papers_room_refuse_closed_ones(cameras, interior_path, tmp_path):
    with TrainingFiles(interior_path) as data, refused(SpecError, "rooms", "metres"):
        train(view_pairs.BASELINE, data, tmp_path, SMALL)
    with refused(SpecError, "rooms", "metres"):
        Completion(Card("x", SMALL))(torch.rand(1, 3, 32, 32), cameras, cameras)
    with RoomsFile(interior_path) as rooms, refused(SpecError, "x.h5", "metres"):
        camera_poses(rooms)  # as of methods that are told no size
