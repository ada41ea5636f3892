"""Submissions: scores of every answer by images alone, and what is refused."""

from pathlib import Path
from typing import Any

import h5py
import pytest
import torch

from baselines.resnets import cnn, siamese
from baselines.resnets.training import Settings, accuracy
from baselines.training.baseline import train, write_submission
from baselines.training.checkpoint import WEIGHTS, load_weights
from baselines.training.data import TrainingFiles
from baselines.training.questions import question_images
from iqtt import open_questions
from metrics.scoring.evaluate import score

BASELINES = {"cnn": cnn.BASELINE, "siamese": siamese.BASELINE}
SMALL = {"width": 4, "size": 16, "batch": 2}
each = pytest.mark.parametrize("name", BASELINES)


@pytest.fixture(scope="module")
def run_folders(train_questions: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Return the folder of a short run of each method, which no test changes."""
    folder = tmp_path_factory.mktemp("runs")
    settings = Settings(seed=1, iterations=3, **SMALL)
    for name, baseline in BASELINES.items():
        train(baseline, TrainingFiles(train_questions), folder / name, settings)
    return {name: folder / name for name in BASELINES}


def scores_of(network: Any, path: Path, row: int) -> Any:
    """Return the scores of one question, seen alone."""
    with open_questions(path) as questions, torch.no_grad():
        return network(torch.from_numpy(question_images(questions, row, 16))[None])[0].numpy()


@each
def test_a_submission_is_valid_and_holds_the_networks_scores(name, run_folders, truths, tmp_path):
    weights, out = run_folders[name] / WEIGHTS, tmp_path / "answers.h5"
    told = []
    baseline = BASELINES[name]
    write_submission(baseline, truths.iqtt, out, weights, progress=lambda *now: told.append(now))
    assert told == [(6, 6)]
    network, card = load_weights(weights, baseline.method)
    with h5py.File(out) as file:
        assert file.attrs["run"] == "3 labels, seed 1"
        for row, scores in enumerate(file["scores"][:]):
            assert scores_of(network, truths.iqtt, row) == pytest.approx(scores, rel=1e-4)
    right = score([out]).metrics["iqtt_accuracy"].value
    val = truths.iqtt.with_name("iqtt-val.h5")
    assert 0 <= right <= 1
    assert card.validation == accuracy(network, val, 16, 3)
