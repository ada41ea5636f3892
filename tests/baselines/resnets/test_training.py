"""Training on labels: answers stay with their questions, and the networks learn them."""

import numpy as np
import pytest
import torch

from baselines.resnets import cnn, siamese
from baselines.resnets.training import Settings, permuted
from baselines.training.baseline import train
from baselines.training.checkpoint import load_weights
from baselines.training.data import TrainingFiles
from baselines.training.machine import Machine


def test_permuted_answers_stay_with_their_questions():
    images = torch.arange(6 * 4.0).view(6, 4, 1, 1, 1).expand(6, 4, 3, 2, 2)
    right = torch.tensor([0, 1, 2, 0, 1, 2])
    seen = set()
    for iteration in range(20):
        mixed, new = permuted(images, right, 5, iteration)
        rows = torch.arange(6)
        assert torch.equal(mixed[:, 0], images[:, 0])
        assert torch.equal(mixed[rows, 1 + new], images[rows, 1 + right])
        values = mixed[:, 1:, 0, 0, 0].sort(dim=1).values
        assert torch.equal(values, images[:, 1:, 0, 0, 0])
        seen |= set(enumerate(new.tolist()))
        assert torch.equal(permuted(images, right, 5, iteration)[1], new)
    assert len(seen) == 18, "the right answer of each question comes to stand everywhere"


@pytest.mark.parametrize("module", [cnn, siamese], ids=["cnn", "siamese"])
def test_it_learns_the_questions_that_it_sees(module, train_questions, tmp_path):
    told = []
    settings = Settings(size=16, width=8, batch=3, learning_rate=0.003, iterations=60)
    how = {"progress": lambda *now: told.append(now)}
    with TrainingFiles(train_questions) as data:
        path = train(module.BASELINE, data, tmp_path, settings, Machine("cpu"), **how)
    losses = [numbers["loss"] for *_, numbers in told[:-1]]
    assert np.mean(losses[-5:]) < 0.3 * np.mean(losses[:5])
    assert [done for done, *_ in told] == [*range(1, 61), 60]
    accuracy = told[-1][2]["accuracy on iqtt-val.h5"]
    assert 0 <= accuracy <= 1
    card = load_weights(path, module.BASELINE.method)[1]
    assert (card.validation, card.answers, card.labels) == (accuracy, 3, 3)
