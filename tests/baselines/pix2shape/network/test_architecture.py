"""Networks: the tables' shapes and parameter counts, and what conditions them."""

import itertools

import pytest
import torch
from pix2shape_models import tiny

from baselines.pix2shape.network import architecture
from baselines.pix2shape.network.architecture import Critic, Decoder, Encoder, NetworkSpec
from baselines.pix2shape.network.model import Pix2Shape, Surfels, Views, shaded
from baselines.pix2shape.network.surfels import Scene

SMALL = NetworkSpec(size=32, width=0.05)


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


def test_conditional_normalisation_normalises_and_then_follows_its_condition() -> None:
    torch.manual_seed(0)
    norm, values = architecture.ConditionalNorm(5, 3), 3 + 2 * torch.randn(64, 5, 4, 4)
    out = norm(values, torch.rand(64, 3))
    assert out.mean(dim=(0, 2, 3)).abs().max() < 1e-5, "scale 1 and shift 0 to begin with"
    assert (out.std(dim=(0, 2, 3)) - 1).abs().max() < 1e-2
    torch.nn.init.normal_(norm.affine[-1].weight)
    first, second = torch.zeros(64, 3), torch.ones(64, 3)
    assert not torch.allclose(norm(values, first), norm(values, second))


def test_critic_scores_depend_on_their_own_item_only() -> None:
    """No batch normalisation: the gradient penalty is each item's own."""
    torch.manual_seed(0)
    critic = Critic(SMALL)
    image, code, camera = torch.rand(4, 3, 32, 32), torch.randn(4, 128), torch.rand(4, 3)
    together = critic(image, code, camera)
    alone = torch.cat([critic(image[[i]], code[[i]], camera[[i]]) for i in range(4)])
    torch.testing.assert_close(together, alone)


def test_bfloat16_reaches_neither_renderer_nor_losses() -> None:
    """An image is the same under autocast, to the bit; codes and scores are full."""
    model = Pix2Shape(tiny()).eval()
    place, color = torch.rand(3, 2, 3) + torch.tensor([0.0, 0.0, 1.5]), torch.rand(3, 2, 3)
    scene = Scene(28.0, place, color, torch.rand(3, 3), torch.rand(3, 2) + 0.2, torch.rand(3, 3))
    views = Views(torch.rand(3, 3), scene)
    depth = 1.5 + 0.1 * torch.rand(3, 32, 32)
    plain = shaded(Surfels(depth), views)
    with torch.autocast("cpu", torch.bfloat16):
        assert torch.equal(shaded(Surfels(depth), views), plain)
        code = model.encode(plain, views)
        score = model.critic(plain, code, views.condition)
        assert {code.dtype, score.dtype, model.image(code, views).dtype} == {torch.float32}
