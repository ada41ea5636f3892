"""Gradients of an expected loss by sampling it: a score-function estimator with antithetic pairs.

The loss is behind a renderer that has no gradients. The decoder's output is taken as the mean of
a Gaussian of fixed width over meshes, and the expected loss is differentiated instead (REINFORCE:
Williams, Machine Learning 8, 1992).
"""

from collections.abc import Callable

import torch
from torch import Tensor

Loss = Callable[[Tensor], Tensor]


def sampled_gradient(
    loss: Loss, mean: Tensor, width: float, pairs: int, generator: torch.Generator
) -> Tensor:
    """Return an unbiased estimate of d E[loss(x)] / d mean, x ~ N(mean, width^2), like `mean`.

    The score of a Gaussian is eps / width, where x = mean + width eps. Samples come in pairs of
    eps and -eps, each the baseline of the other:

        gradient = sum_k eps_k (loss_k+ - loss_k-) / (2 width pairs)
        loss_k+ = loss(mean + width eps_k),  loss_k- = loss(mean - width eps_k)

    It is exact in expectation for the smoothed loss, and for a quadratic loss equals the gradient
    of the loss itself. Where an element of x can only change a part of the loss, the rest of the
    loss is noise to it; then `loss` may return to each element its own part.

    Args:
        loss: (M, B, ...) -> (M, B), or (M, B, V) with a part for each of the elements that follow
            B; called once, and no gradient is asked of it.
        mean: (B, ...); gradients of it are not followed.
        pairs: number of antithetic pairs for each of the B.
    """
    with torch.no_grad():
        noise = torch.randn((pairs, *mean.shape), generator=generator)
        steps = width * torch.cat([noise, -noise])
        losses = loss(mean.detach() + steps)
        difference = (losses[:pairs] - losses[pairs:]) / (2 * width)
        weights = difference.view(*difference.shape, *(1,) * (noise.dim() - difference.dim()))
        return (weights * noise).mean(dim=0)


def with_gradient(value: Tensor, gradient: Tensor) -> Tensor:
    """Return a number whose gradient with respect to `value` is `gradient`."""
    return (value * gradient.detach()).sum()
