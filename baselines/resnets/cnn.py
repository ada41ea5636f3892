"""Four ResNets of shared weights, three fully connected layers, and a softmax over the answers.

Pix2Shape (IJCV 2020), section 3D-IQTT and the appendix's figure "3D-IQTT baseline architecture".
"""

import torch
from torch import Tensor, nn
from torch.nn import functional

from baselines.resnets.architecture import ResNet
from baselines.resnets.training import Card, resnet_baseline
from baselines.training.checkpoint import Method

HIDDEN = (2048, 512, 256)


class AnswerClassifier(nn.Module):
    """Images of a question to the logarithm of each answer's probability.

    The fully connected layers see the features of all images side by side, so that a network is
    made for one number of answers, and nothing in it knows that the order of answers is arbitrary.
    """

    def __init__(self, card: Card) -> None:
        super().__init__()
        self.resnet = ResNet(card.settings.depth, card.settings.width)
        sizes = ((1 + card.answers) * self.resnet.features, *HIDDEN)
        layers: list[nn.Module] = []
        for i in range(len(HIDDEN)):
            layers += [nn.Linear(sizes[i], sizes[i + 1]), nn.ReLU()]
        self.head = nn.Sequential(*layers, nn.Linear(HIDDEN[-1], card.answers))

    def forward(self, images: Tensor) -> Tensor:
        """Return logarithms of probabilities, (Q, K), of images, (Q, 1 + K, 3, S, S).

        In evaluation they are means over K orders of the answers, one in each place once, so that
        no place is preferred.
        """
        features = self.resnet(images.flatten(0, 1)).unflatten(0, images.shape[:2])
        orders = 1 if self.training else images.shape[1] - 1
        scores = []
        for k in range(orders):
            moved = torch.cat([features[:, :1], features[:, 1:].roll(k, dims=1)], dim=1)
            scores.append(torch.log_softmax(self.head(moved.flatten(1)), dim=1).roll(-k, dims=1))
        return torch.stack(scores).mean(dim=0)


BASELINE = resnet_baseline(
    Method("cnn", Card, AnswerClassifier), functional.nll_loss, any_number=False
)
