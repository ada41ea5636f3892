"""Losses against cases computed by hand, and MINE against the closed form of Gaussians."""

import math

import pytest
import torch

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
