"""The weights that come with the package see objects and shapes that they were not trained on.

Those of the reference model have a test of their own, `pix2shape/test_weights.py`.
"""

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from baselines.commands import HOMES
from baselines.training.baseline import Baseline, write_submission
from baselines.training.checkpoint import load_weights
from iqtt import SplitSpec, make_split
from metrics.scoring.evaluate import score

# What is scored, and the least it may be: docs/results.md has more, of 300 scenes.
ROOMS: dict[str, dict[str, float]] = {
    "ptn": {"relief_iou": 0.2},  # a ramp of the mean objects has 0.12
    "view-pairs": {"relief_iou": 0.6},
    "depth-supervised": {"relief_iou": 0.8, "shape_error": 0.5},
    "depth-completed": {"relief_iou": 0.6, "shape_error": 0.3, "behind_depth_error": 0.25},
}
LABELS = {"siamese": 1000, "rezende": 0, "depth-match": 0, "ptn": 0}


def baseline_of(name: str) -> Baseline:
    baseline: Baseline = import_module(f"baselines.{HOMES[name]}").BASELINE
    return baseline


@pytest.fixture(scope="module")
def rooms(make_rooms: Callable[..., Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    size = {"height": 64, "width": 64, "min_visible_pixels": 12}
    path = tmp_path_factory.mktemp("unseen") / "unseen.h5"
    return make_rooms(path, 6, **size, seed=77, views=(0.0, 80.0), lights=(1, 3))


@pytest.mark.parametrize("name", ROOMS)
def test_rooms_are_seen_better_than_by_the_floor(name, rooms, tmp_path):
    """Of skills, 0 is a flat cut-out for shape, and the better of two guesses behind."""
    write_submission(baseline_of(name), rooms, tmp_path / "out.h5")
    scored = score([tmp_path / "out.h5"])
    values = {"relief_iou": scored.metrics["relief_iou"].value}
    values |= {part: skill.value for part, skill in scored.skills.items()}
    assert {part: values[part] for part in ROOMS[name] if values[part] < ROOMS[name][part]} == {}


@pytest.fixture(scope="module")
def questions(tmp_path_factory: pytest.TempPathFactory) -> Any:
    folder = tmp_path_factory.mktemp("questions") / "split"
    spec = SplitSpec(train=0, labeled=0, val=0, test=1, height=64, width=64, min_cube_pixels=0)
    make_split(folder, spec)
    return folder / "iqtt-test.h5"


@pytest.mark.parametrize("name", LABELS)
def test_answers_are_told_apart_by_weights_whose_training_ended(name, questions, tmp_path):
    baseline = baseline_of(name)
    (path,) = (p for p in baseline.files.iterdir() if p.stem in (name, f"{name}-questions"))
    assert path.stat().st_size < 5_000_000
    card = load_weights(path, baseline.method)[1]
    assert (card.labels, card.iteration) == (LABELS[name], card.settings.iterations)
    write_submission(baseline, questions, tmp_path / "a.h5")
    with h5py.File(tmp_path / "a.h5") as file:
        assert len(np.unique(file["scores"][:])) == 3
