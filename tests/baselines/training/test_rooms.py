"""Rooms in memory, and the view of each scene that models predict the others from."""

import h5py
import numpy as np
import pytest
import torch
from pix2shape_models import edited, in_memory, of_rows

from baselines.training.rooms import input_views, room_images
from scenegen import open_rooms


def test_rooms_in_memory_are_those_of_the_file(near_path):
    rooms = in_memory(near_path, 32, depth=True)
    with h5py.File(near_path) as file:
        depth, images = file["depth"][:], file["image"][:]
        np.testing.assert_array_equal(rooms.scene, file["scene_index"][:])
        np.testing.assert_array_equal(rooms.angle, file["view_angle_degrees"][:])
        poses = file["camera/world_from_camera"][:].astype(np.float32)
        assert rooms.fingerprint == file.attrs["fingerprint"]
    np.testing.assert_array_equal(rooms.world_from_camera, poses)
    blocks = depth.reshape(8, 32, 2, 32, 2).mean(axis=(2, 4))
    np.testing.assert_allclose(rooms.depth, blocks, rtol=1e-6)
    blocks = images.astype(float).reshape(8, 32, 2, 32, 2, 3).mean(axis=(2, 4))
    np.testing.assert_allclose(rooms.image, np.moveaxis(blocks, -1, 1), rtol=2e-3)
    assert (len(rooms), rooms.rounded, rooms.image.dtype) == (8, False, torch.float16)
    with open_rooms(near_path) as file:
        some = room_images(file, np.array([5, 2]), 32)
    torch.testing.assert_close(some, rooms.image[[5, 2]].float(), rtol=1e-3, atol=0)


def test_the_input_of_a_scene_is_its_view_0_or_its_first(turned_path, tmp_path):
    with open_rooms(turned_path) as rooms:
        inputs, place = input_views(rooms)
    assert (inputs.tolist(), place.tolist()) == ([0, 3, 6], [0, 0, 0, 1, 1, 1, 2, 2, 2])
    path = edited(turned_path, tmp_path / "mixed.h5", of_rows([8, 6, 5, 4, 3, 2]))
    with open_rooms(path) as rooms, pytest.warns(UserWarning, match="1 of 3 scenes"):
        inputs, place = input_views(rooms)
    assert (inputs.tolist(), place.tolist()) == ([1, 4, 5], [0, 0, 1, 1, 1, 2])
