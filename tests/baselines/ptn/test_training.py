"""Training: it learns, and refuses what does not fit."""

import numpy as np
import pytest
import torch
from ptn_models import TINY, tiny
from refusals import refused

from baselines.ptn.network import Settings
from baselines.ptn.rooms import TrainingRooms
from baselines.ptn.training import BASELINE, projection_loss
from baselines.training.baseline import train
from baselines.training.data import TrainingFiles
from scenegen import open_rooms
from scenegen.common.errors import SpecError

VIEWS = {"views": (0.0, 80.0), "objects": (1, 1), "shapes": ("sphere",)}


@pytest.fixture(scope="module")
def rooms(make_rooms, tmp_path_factory):
    return make_rooms(tmp_path_factory.mktemp("ptn") / "rooms.h5", 2, **VIEWS, seed=1)


@pytest.mark.slow
def test_a_few_rooms_are_learnt_by_heart(rooms):
    # Of the rooms of seeds 0 to 5, those of seed 4 alone end above the bound, at 0.55.
    model = tiny(width=4, batch=4, rays=200, samples=24, views=2, size=32)
    rng = np.random.default_rng(0)
    optimiser = torch.optim.Adam(model.parameters(), lr=3e-3)
    losses = []
    with open_rooms(rooms) as file:
        source = TrainingRooms(file, model.settings)
        for _ in range(100):
            batch = source.batch(rng)
            loss = projection_loss(model, batch)
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
            empty = float((batch.silhouette**2).mean())  # the loss of a volume with nothing in it
            losses.append(float(loss.detach()) / empty)
    assert np.mean(losses[:5]) > 0.7
    assert np.mean(losses[-10:]) < 0.4


def test_what_does_not_fit_is_refused_before_training(rooms, train_questions, tmp_path):
    with refused(SpecError, "labels", "5", "rooms"):
        train(BASELINE, TrainingFiles(rooms), tmp_path / "run", Settings(**TINY), labels=5)
    assert not (tmp_path / "run").exists()
    weights = train(
        BASELINE, TrainingFiles(rooms), tmp_path / "rooms", Settings(**TINY, iterations=1)
    )
    with refused(SpecError, "data", "questions", "rooms"):
        train(BASELINE, TrainingFiles(train_questions), tmp_path / "other", networks=str(weights))
    with refused(SpecError, "data", "questions", "rooms"):
        train(BASELINE, TrainingFiles(train_questions), tmp_path / "rooms", resume=True)
