"""One step: the losses that are asked for, their weighted sum, and gradients where they belong."""

import math
from typing import Any

import pytest
import torch

from baselines.pix2shape.images import Batch
from baselines.pix2shape.network.architecture import NetworkSpec
from baselines.pix2shape.network.config import LOSSES, ModelConfig
from baselines.pix2shape.network.model import Pix2Shape, Views
from baselines.pix2shape.network.surfels import Scene
from baselines.pix2shape.training import losses as functions
from baselines.pix2shape.training.steps import critic_step, draw, generator_step

NETWORKS = NetworkSpec(size=32, width=0.05, z_scene=6, z_view=2)
EACH = tuple(name for name in LOSSES if name != "matching")  # which needs other networks


def only(**weights: float) -> ModelConfig:
    weights = {**dict.fromkeys(LOSSES, 0.0), **weights}
    return ModelConfig(networks=NETWORKS, question_batch=8, **weights)


def model_of(config: ModelConfig) -> Pix2Shape:
    torch.manual_seed(0)
    return Pix2Shape(config)


def some_batch(size: int = 8, seed: int = 1) -> Batch:
    source = torch.Generator().manual_seed(seed)

    def rand(*shape: int) -> Any:
        return torch.rand(size, *shape, generator=source)

    scene = Scene(28.0, 2 * rand(2, 3), rand(2, 3), rand(3), 0.2 + rand(2), 0.2 + rand(3))
    pose = torch.eye(4).repeat(size, 1, 1)
    return Batch(rand(3, 32, 32), Views(rand(3), scene, world_from_camera=pose), 1 + rand(32, 32))


def labelled() -> tuple[Batch, Any]:
    return some_batch(8, seed=2), torch.tensor([2, 0])


def step(config: ModelConfig, batch: Batch | None = None) -> tuple[Any, dict[str, Any]]:
    return generator_step(model_of(config), batch or some_batch(), draw(8, 8, 3), labelled())


def test_the_total_is_the_weighted_sum():
    """Whichever are on: each has the value that it has alone."""
    weights = {name: 0.3 + 0.1 * place for place, name in enumerate(EACH)}
    alone = {name: step(only(**{name: 1.0}))[1][name].item() for name in EACH}
    for chosen in ((), EACH[::2], EACH[1::2], EACH[:4], EACH):
        total, losses = step(only(**{name: weights[name] for name in chosen}))
        assert set(losses) == set(chosen)
        found = {name: value.item() for name, value in losses.items()}
        assert found == pytest.approx({name: alone[name] for name in chosen}, rel=1e-4, abs=1e-6)
        expected = sum(weights[name] * value for name, value in found.items())
        assert total.item() == pytest.approx(expected, rel=1e-5, abs=1e-7)


@pytest.mark.parametrize(
    ("weights", "learn"),
    [
        ({"adversarial": 1.0}, {"critic"}),
        ({"mutual_information": 1.0}, {"statistics"}),
        ({"adversarial": 1.0, "mutual_information": 0.1}, {"critic", "statistics"}),
    ],
)
def test_the_critics_step_teaches_critic_and_statistics_alone(weights, learn):
    model = model_of(only(**weights, reconstruction=1.0))
    total, numbers = critic_step(model, some_batch(), draw(8, 8, 3))
    total.backward()
    for name in ("encoder", "decoder", "critic", "statistics"):
        gradients = [parameter.grad for parameter in getattr(model, name).parameters()]
        if name not in learn:
            assert all(gradient is None for gradient in gradients), name
        else:
            assert any(gradient is not None and gradient.any() for gradient in gradients), name
    assert set(numbers) == ({"distance", "penalty"} if "adversarial" in weights else set())


def test_depth_supervision_ignores_what_is_not_known():
    model, batch = model_of(only(depth=1.0)), some_batch()
    batch.depth[0, :5] = math.nan
    batch.depth[3] = math.nan
    total, losses = generator_step(model, batch, draw(8, 8, 3))
    found = model.surfels(model.encode(batch.image, batch.views), batch.views.condition).depth
    expected = (found - batch.depth).square().nanmean()
    assert losses["depth"].item() == pytest.approx(expected.item(), rel=1e-5)
    total.backward()
    for network in (model.encoder, model.decoder):
        assert all(torch.isfinite(p.grad).all() for p in network.parameters())
    batch.depth[:] = math.nan
    total, _ = generator_step(model, batch, draw(8, 8, 3))
    model.zero_grad()
    total.backward()
    assert total.item() == 0
    assert not any(p.grad.any() for p in model.decoder.parameters())


def test_questions_teach_the_scenes_part_of_the_code():
    model = model_of(only(questions=2.0))
    images, answers = labelled()
    total, losses = generator_step(model, some_batch(), draw(8, 8, 3), (images, answers))
    total.backward()
    gradient = model.encoder.last.bias.grad  # cancels: the loss is of differences
    weight = model.encoder.last.weight.grad.flatten(1).abs().sum(dim=1)
    assert gradient.abs().max() < 1e-5
    assert (weight[:6] > 1e-4).all()
    assert not weight[6:].any()
    codes = model.encode(images.image, images.views)[:, :6].view(2, 4, 6)
    expected = functions.question_loss(codes, answers).item()
    assert losses["questions"].item() == pytest.approx(expected)
