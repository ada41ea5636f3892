"""Losses, each a function of batches of tensors to a number: the paper's, and three of ours.

Pix2Shape (IJCV 2020), sections "Bi-Directional Adversarial Training", "Unsupervised Training" and
"Semi-supervised Training for Classification". Ours are `absolute_loss`, `disagreement` and
`contrast_loss`; docs/pix2shape.md says why.
"""

import math
from collections.abc import Callable

import torch
from torch import Tensor
from torch.nn import functional

from baselines.pix2shape.network.surfels import back_project

HIDDEN = 0.1  # scene units behind another surface at which a surfel counts as hidden by it
NEAR = 0.05  # scene units; what is nearer to the other camera, or behind it, does not count
TEMPERATURE = 0.2  # of mean squared differences of standardised numbers; they are about 2 apart
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


def absolute_loss(values: Tensor, again: Tensor) -> Tensor:
    """Return E ||a - b||_1 / sqrt(n) of two (B, ...) of n numbers each.

    As large as the norm where all numbers are equally wrong, and less dominated by the few that
    are most wrong: pixels at outlines, which belong to two surfaces.
    """
    differences = (values - again).flatten(1)
    return differences.abs().mean() * math.sqrt(differences.shape[1])


def disagreement(
    depth: Tensor, other_depth: Tensor, other_from_camera: Tensor, fov_y_degrees: float
) -> Tensor:
    """Return how far surfels of one view lie from those of another, a mean over those it sees.

    Of each surfel, the difference between its depth in the other camera and what that camera sees
    in its place; surfels out of the other's sight, or behind what it sees by more than HIDDEN, are
    left out. As in learning depth from video (Zhou et al. 2017; Bian et al. 2019), with surfels of
    one code in place of two images' depth maps.

    Args:
        depth, other_depth: (B, S, S), scene units.
        other_from_camera: (B, 4, 4).
    """
    with torch.autocast(depth.device.type, enabled=False):  # differences of near numbers
        points = back_project(depth, fov_y_degrees).flatten(2)
        points = other_from_camera[:, :3, :3] @ points + other_from_camera[:, :3, 3:]
        its_depth = -points[:, 2]
        edge = math.tan(math.radians(fov_y_degrees) / 2) * its_depth.clamp(min=NEAR)
        place = torch.stack([points[:, 0], -points[:, 1]], dim=2) / edge[..., None]
        inverse = functional.grid_sample(  # which is affine on planes
            1 / other_depth[:, None], place[:, None], padding_mode="border", align_corners=False
        )
    behind = its_depth - 1 / inverse[:, 0, 0]
    between_centres = (place.abs() < 1 - 1 / depth.shape[1]).all(dim=2)
    counted = between_centres & (its_depth > NEAR) & (behind < HIDDEN)
    return (behind.abs() * counted).sum() / counted.sum().clamp(min=1)


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


def contrast_loss(codes: Tensor, answers: Tensor) -> Tensor:
    """Return how badly a question's answers are told from those of the other questions, nats.

    One of a question's three answers shows the reference's shape, and hardly any of another
    question's does: so of all answers of a batch, one of its own three is to be the reference's
    nearest. That needs no label; where the right answer is known, it alone counts as the own
    (Miech et al. 2020, MIL-NCE, "End-to-End Learning of Visual Representations").

    Args:
        codes: z_scene of reference and three answers, standardised, (Q, 4, n).
        answers: which of the three is right, (Q,) integers; -1 where that is not known.
    """
    count, _, n = codes.shape
    everyone = codes[:, 1:].reshape(-1, n)
    squared = (codes[:, 0, None] - everyone).square().mean(dim=2)
    likeness = -squared / TEMPERATURE  # (Q, 3 Q)
    place = torch.arange(3 * count, device=codes.device)
    own = place // 3 == torch.arange(count, device=codes.device)[:, None]
    own &= (answers[:, None] < 0) | (place % 3 == answers[:, None])
    nearest = torch.logsumexp(likeness.masked_fill(~own, -torch.inf), dim=1)
    return (torch.logsumexp(likeness, dim=1) - nearest).mean()


def squared_distances(codes: Tensor) -> Tensor:
    """Return the answers' squared distances from the reference: (Q, 4, n) -> (Q, 3)."""
    return ((codes[:, 1:] - codes[:, :1]) ** 2).sum(dim=2)
