"""Configurations: the paper's numbers, JSON both ways, nonsense refused; the model they make."""

import pytest
import torch
from pix2shape_models import tiny

from baselines.pix2shape.network.architecture import NetworkSpec
from baselines.pix2shape.network.config import CONFIGS, ModelConfig, model_config
from baselines.pix2shape.network.model import Pix2Shape
from scenegen.common.errors import SpecError


def test_the_paper_and_rays() -> None:
    paper = model_config("paper")
    assert (paper.iterations, paper.batch, paper.critic_steps) == (60_000, 6, 5)
    assert paper.networks == NetworkSpec()
    rays = model_config("rays", seed=3)
    assert (rays.networks.size, rays.networks.width, rays.seed) == (64, 0.125, 3)
    with pytest.raises(SpecError, match="config"):
        model_config("huge")


@pytest.mark.parametrize("name", CONFIGS)
def test_json_both_ways(name: str) -> None:
    config = model_config(name, learning_rate=1, seed=7)
    again = ModelConfig.from_json(config.to_json())
    assert again == config
    assert hash(again) == hash(config)
    assert '"learning_rate":1.0' in config.to_json(), "equal ones have equal JSON"


@pytest.mark.parametrize(
    ("change", "found"),
    [
        ({"networks.size": 48}, "size: found 48"),
        ({"networks.width": 0.0}, "width: found 0.0"),
        ({"networks.classes": -1}, "classes: found -1"),
        ({"depth_reach": 1.0}, "depth reach: found 1.0"),
        ({"batch": 1}, "batch: found 1"),
        ({"critic_steps": 0}, "critic steps: found 0"),
        ({"learning_rate": 0.0}, "learning rate: found 0.0"),
        ({"contrast": 1.0, "question_batch": 8, "easy_negatives": 0.0}, "negatives: found 0.0"),
        ({"layers": 3}, "unknown field 'layers'"),
    ],
)
def test_nonsense_is_refused(change: dict[str, object], found: str) -> None:
    with pytest.raises(SpecError, match=found):
        model_config("paper", **change)


def test_depth_stays_within_its_reach_whatever_the_code() -> None:
    torch.manual_seed(0)
    model = Pix2Shape(tiny(depth_middle=2.0, depth_reach=0.25))
    torch.nn.init.normal_(model.decoder.last.weight, std=9.0)
    depth = model.surfels(9 * torch.randn(3, 128), torch.rand(3, 3)).depth.detach()
    assert depth.shape == (3, 32, 32)
    assert 1.5 <= float(depth.min()) < 1.6
    assert 2.4 < float(depth.max()) <= 2.5


@pytest.mark.parametrize(
    ("name", "settings", "method"),
    [
        ("paper", {"networks.size": 64, "networks.width": 0.125}, "pix2shape"),
        ("paper", {"mutual_information": 0.0, "questions": 0.0}, "pix2shape"),  # as rooms have it
        ("paper", {"contrast": 1.0}, "pix2shape-compact"),
        ("paper", {"code_reconstruction": 0.0}, "pix2shape-compact"),
        ("paper", {"adversarial": 0.0}, "pix2shape-compact"),
        ("paper", {"absolute_differences": True}, "pix2shape-compact"),
        ("paper", {"depth": 1.0}, "pix2shape-depth"),
        ("rays", {"depth": 1.0}, "pix2shape-depth"),
        ("paper", {"networks.camera": False, "networks.z_view": 10}, "pix2shape"),
        ("paper", {"networks.camera": False, "mutual_information": 0.0}, "pix2shape-compact"),
        ("paper", {"networks.rays": True}, "pix2shape-rays"),
        ("views", {}, "pix2shape-views"),
    ],
)
def test_the_name_of_submissions_tells_the_papers_objective(name, settings, method) -> None:
    assert model_config(name, **settings).method == method
