"""One ResNet for all images, the contrastive loss, and the answer that is nearest to the reference.

Pix2Shape (IJCV 2020), section 3D-IQTT, and the loss of the appendix (Hadsell et al. 2006).
"""

import torch
from torch import Tensor, nn

from baselines.resnets.architecture import ResNet
from baselines.resnets.training import Card, resnet_baseline
from baselines.training.checkpoint import Method

FEATURES = 2048
MARGIN = 2.0


class NearestAnswer(nn.Module):
    """Images of a question to minus the distance of each answer from the reference.

    The features are the 2,048 of ResNet-50; a smaller ResNet gets a linear layer for them.
    """

    def __init__(self, card: Card) -> None:
        super().__init__()
        self.resnet = ResNet(card.settings.depth, card.settings.width)
        enough = self.resnet.features == FEATURES
        self.last = nn.Identity() if enough else nn.Linear(self.resnet.features, FEATURES)

    def forward(self, images: Tensor) -> Tensor:
        """Return minus the distances, (Q, K), of images, (Q, 1 + K, 3, S, S)."""
        features = self.last(self.resnet(images.flatten(0, 1))).view(*images.shape[:2], FEATURES)
        squares: Tensor = (features[:, 1:] - features[:, :1]).square().sum(dim=2)
        return -(squares + 1e-12).sqrt()  # at a distance of 0 the root has no derivative


def contrastive_loss(scores: Tensor, right: Tensor) -> Tensor:
    """Return the mean of the paper's contrastive loss over the pairs of reference and answer.

    The right answer is drawn to the reference; each wrong one is driven from it until it is the
    margin, 2, away.

    Args:
        scores: minus the distances, (Q, K).
        right: which answer is right, (Q,).
    """
    distance = -scores
    same = nn.functional.one_hot(right, scores.shape[1]).bool()
    apart = (MARGIN - distance).clamp(min=0.0)
    return torch.where(same, distance.square(), apart.square()).mean() / 2


BASELINE = resnet_baseline(
    Method("siamese", Card, NearestAnswer), contrastive_loss, any_number=True
)
