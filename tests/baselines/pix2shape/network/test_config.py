"""Configurations: the paper's numbers, JSON both ways, nonsense refused; the model they make."""

import pytest

from baselines.pix2shape.network.architecture import NetworkSpec
from baselines.pix2shape.network.config import model_config
from scenegen.common.errors import SpecError


def test_the_paper_and_rays() -> None:
    paper = model_config("paper")
    assert (paper.iterations, paper.batch, paper.critic_steps) == (60_000, 6, 5)
    assert paper.networks == NetworkSpec()
    rays = model_config("rays", seed=3)
    assert (rays.networks.size, rays.networks.width, rays.seed) == (64, 0.125, 3)
    with pytest.raises(SpecError, match="config"):
        model_config("huge")


@pytest.mark.parametrize(
    ("change", "found"),
    [
        ({"networks.size": 48}, "size: found 48"),
        ({"networks.width": 0.0}, "width: found 0.0"),
        ({"networks.classes": -1}, "classes: found -1"),
        ({"networks.encoder": "polar"}, "encoder: "),  # which is not told the camera
        ({"networks.encoder": "resnet"}, "encoder: .*one of paper, polar"),
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
