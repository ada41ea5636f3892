"""Networks: the tables' shapes and parameter counts, and what conditions them."""

import itertools

import pytest
import torch

from baselines.pix2shape.network import architecture
from baselines.pix2shape.network.architecture import Critic, Decoder, Encoder, NetworkSpec


def count(module: torch.nn.Module) -> int:
    return sum(p.numel() for p in module.parameters())


def convolutions(channels: list[int]) -> int:
    """Parameters of 4x4 convolutions between so many channels, biases included."""
    return sum(16 * a * b + b for a, b in itertools.pairwise(channels))


def conditional(channels: list[int], inputs: int) -> int:
    return sum(64 * (inputs + 1) + 65 * 2 * c for c in channels)


def test_the_papers_networks_have_the_tables_sizes() -> None:
    spec = NetworkSpec()
    assert (spec.z, spec.condition) == (128, 3)
    encoder = convolutions([6, *architecture.ENCODER_CHANNELS, 128])
    assert count(Encoder(spec)) == encoder + conditional([85, 170, 340, 680], 3)
    plain = sum(2 * c for c in (627, 168))
    decoder = convolutions([131, *architecture.DECODER_CHANNELS, 1])
    assert count(Decoder(spec)) == decoder + conditional([1344, 336, 84], 3) + plain
    joined = convolutions([6, 85, 170, 340, 680]) + 16 * (680 + 128) * 1360 + 1360
    assert count(Critic(spec)) == joined + 16 * 1360 + 1
    assert count(architecture.Statistics(spec)) == 128 * 256 + 256 + 256 * 512 + 512 + 512 + 1


@pytest.mark.parametrize(
    ("size", "camera", "classes"),
    [(32, False, 0), (32, False, 3), (64, True, 7), (128, True, 0), (256, True, 0)],
)
def test_all_sizes_and_conditions(size: int, camera: bool, classes: int) -> None:
    spec = NetworkSpec(size=size, width=0.02, camera=camera, classes=classes, z_scene=20, z_view=4)
    image, condition = torch.rand(2, 3, size, size), torch.rand(2, spec.condition)
    code = Encoder(spec)(image, condition)
    assert code.shape == (2, 24)
    assert Decoder(spec)(code, condition).shape == (2, 1, size, size)
    assert Critic(spec)(image, code, condition).shape == (2,)
    assert architecture.Statistics(spec)(code[:, :20], code[:, 20:]).shape == (2,)
