"""True volumes of polycubes find the right answer, and not its mirror image."""

import numpy as np
import pytest
import torch
from ptn_models import cubes_volume, tiny

from baselines.ptn.matching import (
    best_fits,
    features,
    fitted_head,
)
from baselines.ptn.questions import uniform_rotation
from baselines.training.rotations import small_turns
from iqtt.shapes.polycube import mirror

CHAIN = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [2, 1, 0], [2, 2, 0], [2, 2, 1], [2, 2, 2]])
OTHER = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [2, 1, 0], [2, 2, 0], [1, 2, 0], [1, 2, 1]])


def test_small_turns_are_rotations_by_their_angle():
    turns = small_turns(20, 0.3)
    assert torch.linalg.det(turns).numpy() == pytest.approx(1, abs=1e-5)
    assert (turns @ turns.transpose(1, 2) - torch.eye(3)).abs().max() < 1e-5
    angle = (turns.diagonal(dim1=1, dim2=2).sum(dim=1) - 1) / 2
    assert np.arccos(angle.numpy()) == pytest.approx(0.3, abs=1e-4)


def test_the_turned_shape_fits_better_than_its_mirror_image_and_another():
    model, rng = tiny("questions"), np.random.default_rng(1)
    for _ in range(3):
        views = [uniform_rotation(rng) for _ in range(4)]
        shapes = (CHAIN, CHAIN, mirror(CHAIN), OTHER)
        reference, *answers = (
            cubes_volume(model, c, t) for c, t in zip(shapes, views, strict=True)
        )
        fits = best_fits(reference[0], torch.cat(answers))
        assert fits[0] > 0.8
        assert fits[0] > fits[1:].max() + 0.05


def test_features_have_a_number_for_each_answer_whatever_their_number():
    model = tiny("questions")
    images = torch.rand(2, 3, 3, 16, 16, generator=torch.Generator().manual_seed(0))
    images[1, 1] = images[1, 0]
    found = features(model, images)
    assert found.shape == (2, 2, 2)
    assert found[1, 0, 1] == 0  # the same image has the same code
    assert found[1, 1, 1] < 0


def test_labels_weigh_the_feature_that_tells_and_not_the_one_that_does_not():
    rng = np.random.default_rng(2)
    found, right = torch.from_numpy(rng.normal(size=(200, 3, 2))), torch.arange(200) % 3
    found[torch.arange(200), right, 0] += 2
    head = fitted_head(found.float(), right)
    assert head[0] > 5 * abs(head[1])
    assert (
        (found @ torch.tensor(head, dtype=torch.double)).argmax(dim=1) == right
    ).float().mean() > 0.7
