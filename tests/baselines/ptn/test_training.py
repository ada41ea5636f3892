"""Training: it learns, and refuses what does not fit."""

import pytest
from ptn_models import TINY
from refusals import refused

from baselines.ptn.network import Settings
from baselines.ptn.training import BASELINE
from baselines.training.baseline import train
from baselines.training.data import TrainingFiles
from scenegen.common.errors import SpecError

VIEWS = {"views": (0.0, 80.0), "objects": (1, 1), "shapes": ("sphere",)}


@pytest.fixture(scope="module")
def rooms(make_rooms, tmp_path_factory):
    return make_rooms(tmp_path_factory.mktemp("ptn") / "rooms.h5", 2, **VIEWS, seed=1)


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
