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
