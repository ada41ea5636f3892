"""Answers to questions: the nearest scene's, from images alone, and of no training questions."""

from functools import partial
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import torch
from pix2shape_models import made, of_questions

from baselines.pix2shape import predict as module
from baselines.pix2shape.predict import answers_of
from baselines.training.baseline import submit
from baselines.training.images import channels_first
from iqtt.files.reader import open_questions
from metrics.scoring.evaluate import score
from metrics.submissions.reader import open_predictions
from metrics.submissions.validation import validate
from scenegen.rendering.ground_truth import decode_image


@pytest.fixture
def answerer(train_questions: Path) -> Any:
    return made(of_questions(train_questions))


@pytest.fixture(autouse=True)
def few_at_a_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """Questions take several batches."""
    monkeypatch.setattr(module, "BATCH", 4)


def answered(answerer: Any, path: Path, out: Path, **how: Any) -> tuple[list[int], np.ndarray]:
    """Return answers and scores; where only one of them is written, from `metrics`."""
    answers = partial(answers_of, answerer, 0, "")
    size = answerer.config.networks.size
    submit(path, out, "pix2shape", size, answers, overwrite=True, **how)
    with open_predictions(out) as found, h5py.File(out) as file:
        assert found.rows.tolist() == list(range(len(found)))
        return found.answers.tolist(), file["scores"][()]


def distances(answerer: Any, path: Path, part: str | None = None) -> np.ndarray:
    """Return the distances of all answers' z_scene from the reference's, one image at a time."""
    found = []
    with open_questions(path, part) as questions, torch.no_grad():
        for record in questions:
            images = [channels_first(image, 32)[None] for image in decode_image(record.images)]
            told = [(torch.from_numpy(image), torch.empty(1, 0)) for image in images]
            codes = torch.cat([answerer.encoder(*one) for one in told]).double().numpy()
            scene = codes[:, : answerer.config.networks.z_scene]
            found.append(np.linalg.norm(scene[1:] - scene[0], axis=1))
    return np.array(found)


def test_the_nearest_scene_is_the_answer(answerer, truths, tmp_path):
    done: list[tuple[int, int]] = []
    how = {"progress": lambda *step: done.append(step)}
    answers, scores = answered(answerer, truths.iqtt, tmp_path / "a.h5", **how)
    expected = distances(answerer, truths.iqtt)
    np.testing.assert_allclose(scores, -expected, rtol=1e-4)
    assert answers == expected.argmin(axis=1).tolist()
    assert len(set(answers)) > 1
    assert done == [(1, 6)] * 6
    assert [p for p in validate(tmp_path / "a.h5") if not p.is_hint] == []
    assert score([tmp_path / "a.h5"]).method == "pix2shape"
