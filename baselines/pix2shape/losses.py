"""The losses of the paper, each a function of batches of tensors to a number.

Pix2Shape (IJCV 2020), sections "Bi-Directional Adversarial Training", "Unsupervised Training" and
"Semi-supervised Training for Classification".
"""

import math
from collections.abc import Callable

import torch
from torch import Tensor

PENALTY = 10.0  # lambda of the gradient penalty


def critic_loss(real: Tensor, made: Tensor) -> Tensor:
    """What the critic minimises: scores (B,) of (x, G_z(x)) and of (G_x(z), z), Wasserstein."""
    return made.mean() - real.mean()


def generator_loss(real: Tensor, made: Tensor) -> Tensor:
    """What encoder and decoder minimise: the critic's loss with the other sign."""
    return real.mean() - made.mean()


def gradient_penalty(
    critic: Callable[[Tensor, Tensor], Tensor],
    real: tuple[Tensor, Tensor],
    made: tuple[Tensor, Tensor],
    share: Tensor,
) -> Tensor:
    """Return PENALTY E (|grad D| - 1)^2 between the two joint distributions.

    Gulrajani et al. (2017), for pairs: the gradient is that to image and code together.

    Args:
        critic: (images, codes) -> scores (B,).
        real, made: images (B, 3, S, S) and codes (B, z).
        share: of `real` in each point between, (B,).
    """
    points = []
    for one, other in zip(real, made, strict=True):
        weight = share.view(-1, *(1,) * (one.dim() - 1))
        points.append((weight * one + (1 - weight) * other).detach().requires_grad_())
    scores = critic(points[0], points[1])
    slopes = torch.autograd.grad(scores.sum(), points, create_graph=True)
    squared = sum((slope.flatten(1) ** 2).sum(dim=1) for slope in slopes)
    assert isinstance(squared, Tensor)
    return PENALTY * ((torch.sqrt(squared + 1e-12) - 1) ** 2).mean()


def reconstruction_loss(values: Tensor, again: Tensor) -> Tensor:
    """Return E ||a - b||_2, the norm over all numbers of an image or code: two (B, ...)."""
    squared = ((values - again).flatten(1) ** 2).sum(dim=1)
    return torch.sqrt(squared + 1e-12).mean()


def mutual_information(
    statistics: Callable[[Tensor, Tensor], Tensor], first: Tensor, second: Tensor, order: Tensor
) -> Tensor:
    """Return MINE's lower bound of the mutual information of two parts of a code, nats.

    Belghazi et al. (2018): E_joint[T] - log E_marginal[exp T]. The statistics network climbs it,
    the encoder descends.

    Args:
        first, second: (B, n) and (B, m), paired.
        order: permutation of the batch, (B,), that breaks the pairs.
    """
    joint = statistics(first, second)
    marginal = statistics(first, second[order])
    return joint.mean() - (torch.logsumexp(marginal, dim=0) - math.log(len(marginal)))


def question_loss(codes: Tensor, answers: Tensor) -> Tensor:
    """Return the paper's L_theta for labelled mental-rotation questions.

    Half the squared distance of the reference's code to the right answer's, less half of those to
    the two wrong ones.

    Args:
        codes: z_scene of reference and three answers, (Q, 4, n).
        answers: which of the three is right, (Q,) integers.
    """
    squared = squared_distances(codes)
    right = squared.gather(1, answers[:, None]).squeeze(1)
    return (0.5 * right - 0.5 * (squared.sum(dim=1) - right)).mean()


def squared_distances(codes: Tensor) -> Tensor:
    """Return the answers' squared distances from the reference: (Q, 4, n) -> (Q, 3)."""
    return ((codes[:, 1:] - codes[:, :1]) ** 2).sum(dim=2)
