"""Losses against cases computed by hand, and MINE against the closed form of Gaussians."""

import math

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from baselines.pix2shape.network.architecture import NetworkSpec, Statistics
from baselines.pix2shape.training import losses


def test_the_critic_raises_real_scores_and_lowers_made_ones() -> None:
    assert losses.critic_loss(torch.tensor([3.0, 5.0]), torch.tensor([1.0, 2.0])) == -2.5


def test_penalty_of_a_linear_critic_is_that_of_its_slope() -> None:
    """D = 0.5 sum(x) + 2 sum(z): |grad|^2 = 12 / 4 + 4 * 2 = 11, wherever it is taken."""

    def critic(image: torch.Tensor, code: torch.Tensor) -> torch.Tensor:
        return 0.5 * image.sum(dim=(1, 2, 3)) + 2 * code.sum(dim=1)

    real, made = ((torch.rand(5, 3, 2, 2), torch.rand(5, 2)) for _ in range(2))
    found = losses.gradient_penalty(critic, real, made, torch.rand(5))
    assert float(found) == pytest.approx(10 * (math.sqrt(11) - 1) ** 2, rel=1e-6)


def test_penalty_is_taken_between_the_two_and_has_gradients() -> None:
    weight = torch.tensor(1.0, requires_grad=True)

    def critic(image: torch.Tensor, code: torch.Tensor) -> torch.Tensor:
        return weight * (image**2).sum(dim=(1, 2, 3)) / 2 + 0 * code.sum(dim=1)

    real = torch.full((1, 1, 1, 1), 3.0), torch.zeros(1, 1)
    made = torch.full((1, 1, 1, 1), 7.0), torch.zeros(1, 1)
    found = losses.gradient_penalty(critic, real, made, torch.tensor([0.25]))
    assert float(found.detach()) == pytest.approx(10 * (0.25 * 3 + 0.75 * 7 - 1) ** 2, rel=1e-5)
    found.backward()
    assert weight.grad is not None
    assert float(weight.grad) == pytest.approx(20 * (6 - 1) * 6, rel=1e-5)


def test_reconstruction_is_the_norm_of_all_numbers_and_the_mean_of_images() -> None:
    again = torch.stack([torch.full((3, 4), 0.5), torch.full((3, 4), 1.5)])
    assert float(losses.reconstruction_loss(torch.zeros(2, 3, 4), again)) == pytest.approx(
        math.sqrt(12)
    )
    same = torch.rand(2, 8, requires_grad=True)
    losses.reconstruction_loss(same, same.detach()).backward()
    assert torch.isfinite(same.grad).all(), "also where nothing differs"


def test_mutual_information_of_a_known_statistic() -> None:
    first, second, order = torch.tensor([1.0, 2.0]), torch.tensor([3.0, 5.0]), torch.tensor([1, 0])
    found = losses.mutual_information(torch.mul, first, second, order)
    assert float(found) == pytest.approx((3 + 10) / 2 - math.log((math.exp(5) + math.exp(6)) / 2))


def test_mine_finds_the_information_of_correlated_gaussians() -> None:
    """I = -log(1 - r^2) / 2 a dimension, within 0.1 nat."""
    correlation, generator = 0.8, torch.Generator().manual_seed(0)
    torch.manual_seed(0)
    statistics = Statistics(NetworkSpec(z_scene=2, z_view=2))
    optimiser = torch.optim.Adam(statistics.parameters(), lr=3e-3)

    def draw(count: int) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        first = torch.randn(count, 2, generator=generator)
        noise = torch.randn(count, 2, generator=generator)
        second = correlation * first + math.sqrt(1 - correlation**2) * noise
        return first, second, torch.randperm(count, generator=generator)

    for _ in range(150):
        optimiser.zero_grad()
        (-losses.mutual_information(statistics, *draw(256))).backward()
        optimiser.step()
    with torch.no_grad():
        found = float(losses.mutual_information(statistics, *draw(10_000)))
    assert found == pytest.approx(-math.log(1 - correlation**2), abs=0.1)


def test_question_loss_and_answers_by_hand() -> None:
    codes = torch.tensor([[[0.0, 0], [1, 0], [0, 2], [3, 0]], [[1.0, 1], [1, 4], [1, 1], [1, 2]]])
    answers = torch.tensor([0, 1])
    by_hand = [0.5 * 1 - 0.5 * (4 + 9), 0.5 * 0 - 0.5 * (9 + 1)]
    assert float(losses.question_loss(codes, answers)) == pytest.approx(sum(by_hand) / 2)
    assert losses.squared_distances(codes).tolist() == [[1, 4, 9], [9, 0, 1]]


def test_absolute_differences_are_as_large_as_the_norm_where_all_are_equal() -> None:
    values, again = torch.zeros(2, 3, 4, 4), torch.full((2, 3, 4, 4), -0.5)
    for loss in (losses.absolute_loss, losses.reconstruction_loss):
        assert float(loss(values, again)) == pytest.approx(0.5 * math.sqrt(48))
    again[:, 0] = 1.0
    found = float(losses.absolute_loss(values, again))
    assert found == pytest.approx((2 * 0.5 + 1) / 3 * math.sqrt(48))


FOV = 60.0


def ahead(z: float, x: float = 0.0) -> torch.Tensor:
    """Return other_from_camera of a camera moved by z along -z and by x along x, not turned."""
    other_from_camera = torch.eye(4)[None].clone()
    other_from_camera[0, :3, 3] = torch.tensor([-x, 0.0, z])
    return other_from_camera


def test_disagreement_is_the_distance_in_front_and_just_behind() -> None:
    own = torch.full((1, 16, 16), 3.0, requires_grad=True)
    for other in (2.5, 2.95, 3.05, 4.0):
        seen = torch.full((1, 16, 16), other, requires_grad=True)
        found = losses.disagreement(own, seen, torch.eye(4)[None], FOV)
        expected = abs(3 - other) if other > 2.9 else 0.0  # hidden from the other camera
        assert float(found.detach()) == pytest.approx(expected, abs=1e-6)
        slopes = torch.autograd.grad(found, [own, seen], allow_unused=True)
        for slope, sign in zip(slopes, (1, -1), strict=True):
            assert slope is not None
            side = 0 if other < 2.9 else math.copysign(1, 3 - other)
            assert float(slope.sum()) == pytest.approx(sign * side, abs=1e-5)


def test_disagreement_takes_each_image_with_its_own_camera() -> None:
    own, other = (
        torch.tensor(depths).view(2, 1, 1).expand(2, 16, 16) for depths in ((3.0, 4.0), (2.0, 3.5))
    )
    poses = torch.cat([ahead(1.0), ahead(0.5)])
    assert float(losses.disagreement(own, other, poses, FOV)) < 1e-6
    assert float(losses.disagreement(own, other, poses.flip(0), FOV)) > 0.2


def plane_depth(normal: np.ndarray, constant: float, pose: np.ndarray) -> torch.Tensor:
    """Return the depth (1, 32, 32) of the plane normal . P = constant, seen from a camera."""
    edge = math.tan(math.radians(FOV) / 2)
    middle = (np.arange(32) + 0.5 - 16) / 16 * edge
    rays = np.stack(np.broadcast_arrays(middle, -middle[:, None], -1.0), axis=-1)
    return torch.tensor((constant - normal @ pose[:3, 3]) / (rays @ pose[:3, :3].T @ normal))[None]


def test_any_plane_agrees_with_itself_under_any_two_cameras() -> None:
    rng = np.random.default_rng(0)
    for _ in range(5):
        poses = np.tile(np.eye(4), (2, 1, 1))
        poses[:, :3, :3] = Rotation.from_rotvec(rng.normal(0, 0.15, (2, 3))).as_matrix()
        poses[:, :3, 3] = rng.normal(0, 0.3, (2, 3))
        normal = np.array([*rng.normal(0, 0.3, 2), 1.0])
        own, other = (plane_depth(normal, -3.0, pose) for pose in poses)
        other_from_own = torch.tensor(np.linalg.inv(poses[1]) @ poses[0])[None]
        own.requires_grad_()
        found = losses.disagreement(own, other, other_from_own, FOV)
        assert float(found.detach()) < 1e-12
        assert float(losses.disagreement(own.detach(), 1.02 * other, other_from_own, FOV)) > 0.02
        assert torch.isfinite(torch.autograd.grad(found, own)[0]).all()
        wrong = losses.disagreement(own.detach(), other, torch.linalg.inv(other_from_own), FOV)
        assert float(wrong) > 1e-2


def test_disagreement_is_as_exact_where_networks_are_less() -> None:
    own, other = (plane_depth(np.array([0.5, 0.0, 1.0]), c, np.eye(4)).float() for c in (-3, -2))
    with torch.autocast("cpu", dtype=torch.bfloat16):
        assert float(losses.disagreement(own, other, ahead(1.0), FOV)) < 1e-6


def test_contrast_of_one_answer_against_the_others() -> None:
    """Two questions in one dimension, references at 0 and 1; likeness is -5 (difference)^2."""
    codes = torch.tensor([[0.0, 0.2, 1.0, 2.0], [1.0, 0.0, 3.0, 1.0]])[..., None]
    terms = [[0.04, 1.0, 4.0, 0.0, 9.0, 1.0], [0.64, 0.0, 1.0, 1.0, 4.0, 0.0]]
    weights = [[math.exp(-5 * term) for term in row] for row in terms]
    unknown = [sum(weights[0][:3]) / sum(weights[0]), sum(weights[1][3:]) / sum(weights[1])]
    known = [weights[0][1] / sum(weights[0]), weights[1][5] / sum(weights[1])]
    for answers, shares in (
        ([-1, -1], unknown), ([1, 2], known), ([-1, 2], [unknown[0], known[1]]),
    ):  # fmt: skip
        found = float(losses.contrast_loss(codes, torch.tensor(answers)))
        assert found == pytest.approx(-sum(map(math.log, shares)) / 2, rel=1e-5)


def test_pairs_of_a_questions_own_answers_are_hard_negatives() -> None:
    """Of both questions above, pairs of answers 0.2, 1, 2 and 0, 3, 1 apart; temperature 0.4."""
    codes = torch.tensor([[0.0, 0.2, 1.0, 2.0], [1.0, 0.0, 3.0, 1.0]])[..., None]
    terms = [[0.04, 1.0, 4.0, 0.0, 9.0, 1.0], [0.64, 0.0, 1.0, 1.0, 4.0, 0.0]]
    apart = [[0.64, 3.24, 1.0], [9.0, 1.0, 4.0]]
    own, every, pairs = (
        [sum(math.exp(-term / 0.4) for term in row) for row in rows]
        for rows in ((terms[0][:3], terms[1][3:]), terms, apart)
    )
    for easy in (1.0, 0.3, 0.0):
        shares = [
            o / (o + easy * (e - o) + 0.5 * p) for o, e, p in zip(own, every, pairs, strict=True)
        ]
        found = float(losses.contrast_loss(codes, torch.tensor([-1, -1]), 0.4, 0.5, easy))
        assert found == pytest.approx(-sum(map(math.log, shares)) / 2, rel=1e-5)
