"""The losses, each a function of batches of tensors that returns a number.

Most are the paper's: Pix2Shape (IJCV 2020), sections "Bi-Directional Adversarial Training",
"Unsupervised Training" and "Semi-supervised Training for Classification". Two are our own,
`absolute_loss` and `contrast_loss`; docs/pix2shape.md says why.
"""

import math
from collections.abc import Callable

import torch
from torch import Tensor

PENALTY = 10.0  # weight lambda of the gradient penalty


def critic_loss(real: Tensor, made: Tensor) -> Tensor:
    """Return the Wasserstein loss that the critic minimises, and encoder and decoder maximise.

    Args:
        real, made: its scores of (x, G_z(x)) and of (G_x(z), z), (B,) each.
    """
    return made.mean() - real.mean()


def gradient_penalty(
    critic: Callable[[Tensor, Tensor], Tensor],
    real: tuple[Tensor, Tensor],
    made: tuple[Tensor, Tensor],
    share: Tensor,
) -> Tensor:
    """Return PENALTY E (|grad D| - 1)^2 between the two joint distributions.

    As in Gulrajani et al. (2017), with one gradient norm for image and code together.

    Args:
        critic: (images, codes) -> scores (B,).
        real, made: images (B, 3, S, S) and codes (B, z).
        share: weight of `real` in the points between `real` and `made`, (B,).
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
    """Return E ||a - b||_2, where the norm is over all numbers of an image or code, (B, ...)."""
    squared = ((values - again).flatten(1) ** 2).sum(dim=1)
    return torch.sqrt(squared + 1e-12).mean()


def absolute_loss(values: Tensor, again: Tensor) -> Tensor:
    """Return E ||a - b||_1 / sqrt(n) of images or codes, (B, ...), of n numbers each.

    It equals the norm where all differences are equally large, and is less dominated by a few large
    ones, such as those of pixels at outlines, whose surfel belongs to two surfaces.
    """
    differences = (values - again).flatten(1)
    return differences.abs().mean() * math.sqrt(differences.shape[1])


def mutual_information(
    statistics: Callable[[Tensor, Tensor], Tensor], first: Tensor, second: Tensor, order: Tensor
) -> Tensor:
    """Return MINE's lower bound of the mutual information of two parts of a code, nats.

    E_joint[T] - log E_marginal[exp T], Belghazi et al. (2018). The statistics network maximises
    it, the encoder minimises it.

    Args:
        statistics: T, a function of the two parts to numbers (B,).
        first, second: the parts, (B, n) and (B, m).
        order: permutation of the batch, (B,), that makes pairs of the marginal distribution.
    """
    joint = statistics(first, second)
    marginal = statistics(first, second[order])
    return joint.mean() - (torch.logsumexp(marginal, dim=0) - math.log(len(marginal)))


def question_loss(codes: Tensor, answers: Tensor) -> Tensor:
    """Return the paper's L_theta (equation "app-loss") for labelled mental-rotation questions.

    It is half the squared distance between the codes of reference and right answer, minus half the
    squared distances between the reference and the wrong answers.

    Args:
        codes: z_scene of reference and K answers, (Q, 1 + K, n).
        answers: which of them is right, (Q,) integers.
    """
    squared = squared_distances(codes)
    right = squared.gather(1, answers[:, None]).squeeze(1)
    return (0.5 * right - 0.5 * (squared.sum(dim=1) - right)).mean()


def contrast_loss(
    codes: Tensor,
    answers: Tensor,
    temperature: float = 0.2,
    hard_negatives: float = 0.0,
    easy_negatives: float = 1.0,
) -> Tensor:
    """Return how badly a reference's code tells its own answers from other questions' ones, nats.

    One of a question's answers shows the reference's shape, and hardly any answer of another
    question does. So among all answers of a batch, the nearest to the reference should be one of
    its own. That needs no label; where the right answer is told, it alone counts as own.
    This is MIL-NCE (Miech et al. 2020, "End-to-End Learning of Visual Representations").

    A question's images share more than their shape: number of cubes and distance of the camera.
    Two of its answers share all that, too, and yet show different shapes. As `hard_negatives`
    these pairs count as further answers that the reference's own have to be nearer than.

    Args:
        codes: z_scene of reference and K answers, standardised, (Q, 1 + K, n).
        answers: which of them is right, (Q,) integers; -1 where that is not known.
        temperature: divides mean squared differences, about 2 at first.
        hard_negatives: weight of the pairs of a question's own answers; 0 leaves them out.
        easy_negatives: weight of the answers of other questions; 0 leaves them out.
    """
    count, offered, n = len(codes), codes.shape[1] - 1, codes.shape[2]
    everyone = codes[:, 1:].reshape(-1, n)
    squared = (codes[:, 0, None] - everyone).square().mean(dim=2)
    likeness = -squared / temperature  # (Q, K Q)
    place = torch.arange(offered * count, device=codes.device)
    own = place // offered == torch.arange(count, device=codes.device)[:, None]
    easy = ~own
    own &= (answers[:, None] < 0) | (place % offered == answers[:, None])
    nearest = torch.logsumexp(likeness.masked_fill(~own, -torch.inf), dim=1)
    if easy_negatives != 1:
        weight = math.log(easy_negatives) if easy_negatives else -math.inf
        likeness = torch.where(easy, likeness + weight, likeness)
    if hard_negatives:
        one, other = torch.triu_indices(offered, offered, 1, device=codes.device)
        apart = (codes[:, 1 + one] - codes[:, 1 + other]).square().mean(dim=2)
        pairs = math.log(hard_negatives) - apart / temperature
        likeness = torch.cat([likeness, pairs], dim=1)
    return (torch.logsumexp(likeness, dim=1) - nearest).mean()


def squared_distances(codes: Tensor) -> Tensor:
    """Return squared distances between reference and answers: codes (Q, 1 + K, n) -> (Q, K)."""
    return ((codes[:, 1:] - codes[:, :1]) ** 2).sum(dim=2)
