"""What each network may be asked, and that depth stays between the room's walls and open sides."""

import pytest
import torch

from baselines.pix2shape.network.architecture import contrast
from baselines.pix2shape.network.empty_rooms import Cameras, empty_rooms
from baselines.relief.network import Card, Settings, predicted_depth, relief_network


def cameras(*positions: tuple[float, float, float]) -> Cameras:
    pose = torch.eye(4).repeat(len(positions), 1, 1)
    pose[:, :3, 3] = torch.tensor(positions)
    return Cameras(pose, 30.0)


def network_of(kind: str, size: int) -> torch.nn.Module:
    return relief_network(Card("depth-supervised", Settings(kind, size, 0.1)))


OWN, OTHER = cameras((0.5, 0.5, 2.0), (0.4, 0.6, 2.2)), cameras((0.6, 0.5, 2.1), (0.3, 0.5, 2.0))


@pytest.mark.parametrize("size", [32, 64])
@pytest.mark.parametrize("kind", ["unet", "code"])
def test_depth_lies_between_the_walls_and_the_open_sides(kind, size):
    torch.manual_seed(0)
    network = network_of(kind, size).eval()
    image = torch.rand(2, 3, size, size)
    walls, entry, _ = empty_rooms(OWN.world_from_camera, 30.0, size)
    with torch.no_grad():
        relief = network(image, OWN, OWN)
        last = network.last if kind == "unet" else network.decoder.last
        for factor in (1.0, 1e4):
            last.weight.mul_(factor)
            depth = predicted_depth(network, image, OWN, OWN)
            assert depth.shape == relief.shape == (2, size, size)
            assert (depth <= walls).all()
            assert (depth >= entry).all()
    assert (depth == walls).any()
    assert (depth == entry).any()


def test_a_unet_sees_with_the_images_own_camera_alone():
    network = network_of("unet", 32)
    with pytest.raises(ValueError, match="own camera"):
        network(torch.rand(2, 3, 32, 32), OWN, OTHER)


def test_a_code_is_seen_from_any_camera():
    torch.manual_seed(0)
    network = network_of("code", 32).train()
    image = torch.rand(2, 3, 32, 32)
    for _ in range(2):  # the condition's layers begin at 0
        loss = (network(image, OWN, OWN) - torch.rand(2, 32, 32)).square().mean()
        loss.backward()
        with torch.no_grad():
            for weights in network.parameters():
                weights.sub_(0.1 * weights.grad)
    assert not torch.allclose(network(image, OWN, OWN), network(image, OWN, OTHER))


def test_contrast_is_blind_to_what_is_even():
    even = torch.full((1, 3, 16, 16), 0.3)
    torch.testing.assert_close(contrast(even), torch.zeros_like(even), atol=1e-5, rtol=0)
    even[0, 0, 8, 8] += 0.81
    assert float(contrast(even)[0, 0, 8, 8]) == pytest.approx(8 * 0.8)
