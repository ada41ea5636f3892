"""The sampled gradient is that of the expected loss, also where the loss has none."""

import math

import numpy as np
import torch

from baselines.rezende.training import sampled_gradient

PAIRS = 20_000


def estimate(loss, mean, width, pairs=PAIRS, seed=1):
    """Return the mean estimate of single pairs, and its standard error."""
    rows = mean.expand(pairs, *mean.shape).clone()
    each = sampled_gradient(loss, rows, width, 1, torch.Generator().manual_seed(seed))
    return each.mean(dim=0), each.std(dim=0) / math.sqrt(pairs)


def test_a_quadratic_loss_gives_its_own_gradient():
    rng = np.random.default_rng(0)
    root, slope = (torch.from_numpy(rng.normal(size=s)).float() for s in ((5, 5), (5,)))
    matrix = root @ root.T
    mean = torch.from_numpy(rng.normal(size=5)).float()

    def loss(x):
        return 0.5 * torch.einsum("...i,ij,...j->...", x, matrix, x) + x @ slope

    found, error = estimate(loss, mean, 0.3)
    true = matrix @ mean + slope
    assert (abs(found - true) < 4.5 * error).all()
    assert (error < 0.05 * true.norm()).all()


def test_a_step_without_any_derivative_gives_the_density_at_the_step():
    mean, width = torch.tensor([0.1]), 0.4
    found, error = estimate(lambda x: (x[..., 0] > 0).float(), mean, width)
    density = math.exp(-0.5 * (0.1 / width) ** 2) / (width * math.sqrt(2 * math.pi))
    assert abs(found - density) < 4.5 * error
    assert error < 0.02 * density
