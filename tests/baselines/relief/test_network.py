"""What each network may be asked, and that depth stays between the room's walls and open sides."""

import pytest
import torch

from baselines.pix2shape.matching.search import reliefs
from baselines.pix2shape.network.architecture import contrast
from baselines.pix2shape.network.empty_rooms import Cameras, empty_rooms
from baselines.relief.depth_completed import THICK, Completion
from baselines.relief.network import Card, Settings, UNet, predicted_depth, relief_network


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


def test_a_unet_sees_with_the_images_own_camera_alone():
    network = UNet(small(32))
    with pytest.raises(ValueError, match="own camera"):
        network(torch.rand(2, 3, 32, 32), OWN, OTHER)


def test_a_completion_is_told_how_far_points_lie_behind_what_is_seen(monkeypatch):
    """Seen from its own camera, the surface lies at the relief that the first network gives."""
    network, told = Completion(Card("x", small(32))).eval(), []
    monkeypatch.setattr(network.seen, "forward", lambda *_: torch.full((2, 32, 32), 0.1))
    monkeypatch.setattr(network.completed, "relief", told.append)
    for targets in (OWN, OTHER):
        network(torch.rand(2, 3, 32, 32), OWN, targets)
    behind = told[0][:, : len(reliefs(told[0])), 1:-1, 1:-1]
    expected = (0.1 - reliefs(behind)) / THICK
    torch.testing.assert_close(behind.mean(dim=(0, 2, 3)), expected.clamp(-1, 1), atol=1e-3, rtol=0)
    assert not torch.allclose(*told)


def test_contrast_is_blind_to_what_is_even():
    even = torch.full((1, 3, 16, 16), 0.3)
    torch.testing.assert_close(contrast(even), torch.zeros_like(even), atol=1e-5, rtol=0)
    even[0, 0, 8, 8] += 0.81
    assert float(contrast(even)[0, 0, 8, 8]) == pytest.approx(8 * 0.8)
