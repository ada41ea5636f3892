"""The classifier: layers as in the paper, and one output for each answer."""

import pytest
import torch

from baselines.resnets.cnn import AnswerClassifier
from baselines.resnets.training import Card, Settings


@pytest.mark.parametrize("answers", [2, 3])
def test_layers_and_probabilities(answers):
    network = AnswerClassifier(
        Card("cnn", Settings(width=4, size=16), labels=1, answers=answers)
    ).eval()
    widths = [layer.out_features for layer in network.head if isinstance(layer, torch.nn.Linear)]
    assert widths == [2048, 512, 256, answers]
    images = torch.rand(2, 1 + answers, 3, 16, 16)
    moved = torch.cat([images[:, :1], images[:, 1:].roll(1, dims=1)], dim=1)
    assert torch.allclose(network(moved), network(images).roll(1, dims=1), atol=1e-6)
    network.training = True  # of one order; its parts stay in evaluation
    scores = network(images)
    assert not torch.allclose(network(moved), scores.roll(1, dims=1), atol=1e-4)
    assert scores.shape == (2, answers)
    assert scores.detach().exp().sum(dim=1) == pytest.approx(1.0)
    # The first layer sees the features of every image, in the order of the images.
    alone = torch.cat([network.resnet(images[:, k]) for k in range(1 + answers)], dim=1)
    assert torch.allclose(network.head(alone).log_softmax(1), scores, atol=1e-5)
