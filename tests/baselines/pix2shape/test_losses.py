"""Losses against cases computed by hand, and MINE against the closed form of Gaussians."""

import math

import pytest

torch = pytest.importorskip("torch")
from baselines.pix2shape.losses import (  # noqa: E402
    critic_loss,
    generator_loss,
    gradient_penalty,
    mutual_information,
    question_loss,
    reconstruction_loss,
    squared_distances,
)
from baselines.pix2shape.networks import NetworkSpec, Statistics  # noqa: E402


def test_critic_and_generator_want_the_opposite() -> None:
    real, made = torch.tensor([3.0, 5.0]), torch.tensor([1.0, 2.0])
    assert critic_loss(real, made) == -2.5
    assert generator_loss(real, made) == 2.5


def test_penalty_of_a_linear_critic_is_that_of_its_slope() -> None:
    """D = 0.5 sum(x) + 2 sum(z): |grad|^2 = 12 / 4 + 4 * 2 = 11, wherever it is taken."""

    def critic(image: torch.Tensor, code: torch.Tensor) -> torch.Tensor:
        return 0.5 * image.sum(dim=(1, 2, 3)) + 2 * code.sum(dim=1)

    real = torch.rand(5, 3, 2, 2), torch.rand(5, 2)
    made = torch.rand(5, 3, 2, 2), torch.rand(5, 2)
    found = gradient_penalty(critic, real, made, torch.rand(5))
    assert float(found) == pytest.approx(10 * (math.sqrt(11) - 1) ** 2, rel=1e-6)


def test_penalty_is_taken_between_the_two_and_has_gradients() -> None:
    weight = torch.tensor(1.0, requires_grad=True)

    def critic(image: torch.Tensor, code: torch.Tensor) -> torch.Tensor:
        return weight * (image**2).sum(dim=(1, 2, 3)) / 2 + 0 * code.sum(dim=1)

    real = torch.full((1, 1, 1, 1), 3.0), torch.zeros(1, 1)
    made = torch.full((1, 1, 1, 1), 7.0), torch.zeros(1, 1)
    found = gradient_penalty(critic, real, made, torch.tensor([0.25]))
    assert float(found.detach()) == pytest.approx(10 * (0.25 * 3 + 0.75 * 7 - 1) ** 2, rel=1e-5)
    found.backward()
    assert weight.grad is not None
    assert float(weight.grad) == pytest.approx(20 * (6 - 1) * 6, rel=1e-5)


def test_reconstruction_is_the_norm_of_all_numbers_and_the_mean_of_images() -> None:
    again = torch.stack([torch.full((3, 4), 0.5), torch.full((3, 4), 1.5)])
    assert float(reconstruction_loss(torch.zeros(2, 3, 4), again)) == pytest.approx(math.sqrt(12))
    same = torch.rand(2, 8, requires_grad=True)
    reconstruction_loss(same, same.detach()).backward()
    assert torch.isfinite(same.grad).all(), "also where nothing differs"


def test_mutual_information_of_a_known_statistic() -> None:
    first, second = torch.tensor([[1.0], [2.0]]), torch.tensor([[3.0], [5.0]])

    def product(a: torch.Tensor, b: torch.Tensor) -> torch.Tensor:
        return (a * b).flatten()

    found = mutual_information(product, first, second, torch.tensor([1, 0]))
    assert float(found) == pytest.approx((3 + 10) / 2 - math.log((math.exp(5) + math.exp(6)) / 2))


@pytest.mark.parametrize("correlation", [0.0, 0.5, 0.8])
def test_mine_finds_the_information_of_correlated_gaussians(correlation: float) -> None:
    """I = -log(1 - r^2) / 2 a dimension, within 0.1 nat."""
    generator = torch.Generator().manual_seed(0)
    torch.manual_seed(0)
    statistics = Statistics(NetworkSpec(z_scene=2, z_view=2))
    optimiser = torch.optim.Adam(statistics.parameters(), lr=1e-3)

    def draw(count: int) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        first = torch.randn(count, 2, generator=generator)
        noise = torch.randn(count, 2, generator=generator)
        second = correlation * first + math.sqrt(1 - correlation**2) * noise
        return first, second, torch.randperm(count, generator=generator)

    for _ in range(500):
        optimiser.zero_grad()
        (-mutual_information(statistics, *draw(512))).backward()
        optimiser.step()
    with torch.no_grad():
        found = float(mutual_information(statistics, *draw(20_000)))
    assert found == pytest.approx(-math.log(1 - correlation**2), abs=0.1)


def test_question_loss_and_answers_by_hand() -> None:
    codes = torch.tensor([[[0.0, 0], [1, 0], [0, 2], [3, 0]], [[1.0, 1], [1, 4], [1, 1], [1, 2]]])
    answers = torch.tensor([0, 1])
    by_hand = [0.5 * 1 - 0.5 * (4 + 9), 0.5 * 0 - 0.5 * (9 + 1)]
    assert float(question_loss(codes, answers)) == pytest.approx(sum(by_hand) / 2)
    assert squared_distances(codes).tolist() == [[1, 4, 9], [9, 0, 1]]
