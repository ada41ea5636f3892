"""What each network may be asked, and that depth stays between the room's walls and open sides."""

import pytest
import torch

from baselines.pix2shape.network.empty_rooms import Cameras, empty_rooms
from baselines.relief.depth_completed import Completion
from baselines.relief.network import Card, Settings, predicted_depth, relief_network


def cameras(*positions: tuple[float, float, float]) -> Cameras:
    pose = torch.eye(4).repeat(len(positions), 1, 1)
    pose[:, :3, 3] = torch.tensor(positions)
    return Cameras(pose, 30.0)


def small(size: int) -> Settings:
    return Settings(size=size, width=0.1)


OWN, OTHER = cameras((0.5, 0.5, 2.0), (0.4, 0.6, 2.2)), cameras((0.6, 0.5, 2.1), (0.3, 0.5, 2.0))


@pytest.mark.parametrize("size", [32, 64])
@pytest.mark.parametrize("kind", [relief_network, Completion])
def test_depth_lies_between_the_walls_and_the_open_sides(kind, size):
    torch.manual_seed(0)
    network = kind(Card("x", small(size))).eval()
    image = torch.rand(2, 3, size, size)
    walls, entry, _ = empty_rooms(OWN.world_from_camera, 30.0, size)
    with torch.no_grad():
        relief = network(image, OWN, OWN)
        last = getattr(network, "completed", network).last
        for factor in (1.0, 1e4):
            last.weight.mul_(factor)
            depth = predicted_depth(network, image, OWN, OWN)
            assert depth.shape == relief.shape == (2, size, size)
            assert (depth <= walls).all()
            assert (depth >= entry).all()
    assert (depth == walls).any()
    assert (depth == entry).any()
