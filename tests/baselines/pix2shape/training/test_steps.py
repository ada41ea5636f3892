"""One step: the losses that are asked for, their weighted sum, and gradients where they belong."""

import math
from dataclasses import replace
from typing import Any

import pytest
import torch

from baselines.pix2shape.batch import Batch, Relief
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


def facing_the_origin(place: Any) -> Any:
    """Return cameras at places (B, 3), upright, that look at the origin: world_from_camera."""
    back = torch.nn.functional.normalize(place, dim=1)
    right = torch.linalg.cross(torch.tensor([[0.0, 0.0, 1.0]]).expand_as(back), back)
    right = torch.nn.functional.normalize(right, dim=1)
    pose = torch.eye(4).repeat(len(place), 1, 1)
    pose[:, :3] = torch.stack([right, torch.linalg.cross(back, right), back, place], dim=2)
    return pose


def test_matching_compares_relief_in_one_view_of_each_scene():
    networks = NetworkSpec(size=32, width=0.05, z_scene=3, rays=True)
    model = model_of(replace(only(), networks=networks, matching=1.0))
    batch, noise = some_batch(), draw(8, 3, 3)
    place = 0.5 + batch.views.condition
    poses = facing_the_origin(place)[:, None].repeat(1, 2, 1, 1)
    poses[:, 1, 0, 3] += 0.1
    found = torch.rand(8, 2, 32, 32)
    views = replace(batch.views, world_from_camera=poses[:, 0])
    batch = replace(batch, views=views, relief=Relief(found, poses))
    total, losses = generator_step(model, batch, noise)
    drawn = (noise.share >= 0.5).long()
    assert 0 < drawn.sum() < 8, "either view is drawn for some"
    code = model.encode(batch.image, views)
    each = torch.arange(8)
    said = model.relief(code, poses[each, drawn, :3, 3])
    expected = (said - found[each, drawn]).abs().mean()
    assert losses["matching"].item() == pytest.approx(expected.item(), rel=1e-5)
    total.backward()
    assert model.encoder.layers[0].weight.grad.any()


def test_noise_is_the_seeds():
    state = torch.get_rng_state()
    one, again, other = draw(9, 4, 7, 5, 3), draw(9, 4, 7, 5, 3), draw(9, 4, 8, 5, 3)
    assert torch.equal(torch.get_rng_state(), state), "no other random numbers are touched"
    assert (one.code.shape, one.share.shape) == ((9, 4), (9,))
    assert sorted(one.order.tolist()) == list(range(9))
    assert 0 <= one.share.min() <= one.share.max() <= 1
    assert 0 <= one.turn.min() < one.turn.max() <= 2 * math.pi
    by_question = one.mirror.view(5, 3)
    assert torch.equal(by_question.all(dim=1), by_question.any(dim=1)), "a question's, or none"
    assert by_question.any()
    assert not by_question.all()
    for name in ("code", "share", "order"):  # the same, whatever is compared
        assert torch.equal(getattr(one, name), getattr(draw(9, 4, 7), name))
    for name in ("code", "share", "order", "turn", "mirror"):
        assert torch.equal(getattr(one, name), getattr(again, name))
        assert not torch.equal(getattr(one, name), getattr(other, name))
