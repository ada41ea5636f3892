"""What a run begins from: weights of its own kind, settings that the data leave as they were."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from pix2shape_models import stored, tiny
from refusals import refused

from baselines.pix2shape.network.config import model_config
from baselines.pix2shape.training.beginnings import new_run
from baselines.training.data import TrainingFiles
from scenegen.common.errors import SceneGenError, SpecError

CONFIG = tiny(seed=3)
OTHER = replace(CONFIG, adversarial=0.0)
SMALL = {"networks.size": 32, "networks.width": 0.05}


def card_of(data: Path, config: Any = CONFIG, **how: Any) -> Any:
    return new_run(TrainingFiles(data), config, **how)[0].card


def untrained(path: Path, data: Path, config: Any = CONFIG, **how: Any) -> Path:
    """Write the weights with which a run begins."""
    state = new_run(TrainingFiles(data), config, **how)[0]
    return stored(path, state.network, state.card)


@pytest.mark.parametrize(
    ("data", "how", "where"),
    [
        ("rooms", {"labels": 1}, "labels"),
        ("rooms", {"conditional": True}, "conditional"),
        ("questions", {"conditional": True}, "iqtt-train.h5"),
        ("questions", {"labels": 4}, "labels"),
        ("questions", {"labels": -1}, "labels"),
        ("test", {}, "iqtt-test.h5"),
        ("large", {}, "rooms.h5"),
    ],
)
def test_what_does_not_go_together(data, how, where, truths, train_questions):
    paths = {"rooms": truths.rooms, "large": truths.rooms, "test": truths.iqtt}
    path = {**paths, "questions": train_questions}[data]
    with refused(SceneGenError, where):
        new_run(TrainingFiles(path), tiny(size=64) if data == "large" else CONFIG, **how)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"networks": replace(CONFIG.networks, width=0.06)}, "width"),
        ({"depth_reach": 0.3}, "depth_reach"),
        ({"depth_middle": 1.6}, "depth_middle"),
        ({"lights": 3}, "lights"),
        ({"material": True}, "material"),
    ],
)
def test_a_run_begins_from_models_of_its_own_kind_alone(change, told, rooms_path, tmp_path):
    start = untrained(tmp_path / "a.safetensors", rooms_path)
    with refused(SpecError, "start", found=f"with {told} "):
        new_run(TrainingFiles(rooms_path), replace(CONFIG, **change), start=start)


def test_weights_of_other_losses_do_not_become_the_papers(rooms_path, tmp_path):
    """What other losses trained keeps its name: no short run gives it that of the objective."""
    start = untrained(tmp_path / "other.safetensors", rooms_path, OTHER)
    assert (OTHER.method, CONFIG.method) == ("pix2shape-compact", "pix2shape")
    with refused(SpecError, "start"):
        new_run(TrainingFiles(rooms_path), CONFIG, start=start)
    assert card_of(rooms_path, OTHER, start=start).submission == "pix2shape-compact"


def test_depth_maps_of_earlier_runs_are_not_forgotten(rooms_path, tmp_path):
    start = None
    for number, (depth, earlier) in enumerate(((1.0, False), (0.0, True), (0.0, True))):
        state, _ = new_run(TrainingFiles(rooms_path), replace(OTHER, depth=depth), start=start)
        card = state.card
        assert (card.earlier_depth, card.submission) == (earlier, "pix2shape-depth")
        start = stored(tmp_path / f"{number}.safetensors", state.network, card)
    with refused(SpecError, "start"):
        new_run(TrainingFiles(rooms_path), CONFIG, start=start)


@pytest.mark.parametrize(
    ("data", "name", "value"),
    [
        ("rooms", "contrast", 2.0),
        ("rooms", "turned", True),
        ("rooms", "question_batch", 64),
        ("questions", "networks.camera", True),
        ("questions", "networks.z_scene", 60),
        ("questions", "questions", 1.0),
    ],
)
def test_what_somebody_chose_is_not_changed(data, name, value, rooms_path, train_questions):
    """And what nobody chose is changed as the data need it."""
    path = rooms_path if data == "rooms" else train_questions
    config = model_config("paper", **SMALL, **{name: value})
    with refused(SpecError, name):
        new_run(TrainingFiles(path), config, chosen=[*SMALL, name])
    assert new_run(TrainingFiles(path), config, chosen=SMALL)
