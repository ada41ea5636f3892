"""The networks are those of He et al. (2016): as many weights, and sizes of feature maps."""

import pytest
import torch

from baselines.resnets.architecture import ResNet


@pytest.mark.parametrize(
    ("depth", "parameters", "features"),
    # As published for 1,000 classes, 11,689,512 and 25,557,032, less the last layer.
    [(18, 11_689_512 - 513_000, 512), (50, 25_557_032 - 2_049_000, 2048)],
)
def test_weights_are_as_many_as_published(depth, parameters, features):
    with torch.device("meta"):
        network = ResNet(depth)
    assert sum(p.numel() for p in network.parameters()) == parameters
    assert network.features == features


@pytest.mark.parametrize("depth", [18, 50])
@pytest.mark.parametrize("size", [16, 64, 224])
def test_the_last_map_is_a_32nd_of_the_image(depth, size):
    network = ResNet(depth, width=4).eval()
    images = torch.rand(2, 3, size, size)
    side = -(-size // 32)
    assert network.layers(images).shape == (2, network.features, side, side)
    assert network(images).shape == (2, network.features)
    assert (network(images)[0] != network(images)[1]).any()
