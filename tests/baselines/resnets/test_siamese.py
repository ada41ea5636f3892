"""Distances of features, and the contrastive loss of the paper's appendix."""

import pytest
import torch

from baselines.resnets.siamese import NearestAnswer, contrastive_loss
from baselines.resnets.training import Card, Settings

SMALL = Card("siamese", Settings(width=4, size=16), labels=1)


@pytest.mark.parametrize("answers", [2, 3])
def test_scores_are_minus_the_distance_from_the_reference(answers):
    network = NearestAnswer(SMALL).eval()
    images = torch.rand(2, 1 + answers, 3, 16, 16)
    images[0, 2] = images[0, 0]
    scores = network(images)
    assert scores.shape == (2, answers)
    assert scores.detach()[0, 1] == pytest.approx(0, abs=1e-4)
    features = network.last(network.resnet(images[1]))
    assert features.shape == (1 + answers, 2048)
    apart = torch.dist(features[1], features[0]).item()
    assert scores.detach()[1, 0] == pytest.approx(-apart, rel=1e-4)


def paper(distance, different):
    """The appendix's equation for one pair of images, with margin 2."""
    return (1 - different) * distance**2 / 2 + different * max(0.0, 2.0 - distance) ** 2 / 2


def test_the_loss_is_the_papers():
    distances = [[0.5, 1.5, 3.0], [2.5, 0.0, 1.0]]
    right = [0, 2]
    expected = [paper(distances[q][k], float(k != right[q])) for q in range(2) for k in range(3)]
    found = contrastive_loss(-torch.tensor(distances), torch.tensor(right))
    assert found == pytest.approx(sum(expected) / 6)
