"""Features answer by the nearest; labels teach which dimensions count; misfits are refused."""

from pathlib import Path

import h5py
import numpy as np
import pytest
from click.testing import CliRunner
from refusals import refused

from baselines.features import cosines_with_reference, probe_scores, read_features, write_features
from cli import bench
from iqtt import open_questions
from scenegen.common.errors import FileFormatError, SceneGenError, SpecError


def told_by_one(count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return features whose dimension 3 tells the answer, beside louder noise, and the answers."""
    rng = np.random.default_rng(seed)
    features, right = rng.normal(size=(count, 4, 12)), rng.integers(0, 3, count)
    features[..., 3] = rng.normal(size=(count, 4))
    features[np.arange(count), 1 + right, 3] = features[:, 0, 3]
    return features, right


def test_labels_teach_which_dimension_counts():
    (learned, answers), (seen, right) = told_by_one(300, 1), told_by_one(200, 2)
    assert (cosines_with_reference(seen).argmax(axis=1) == right).mean() < 0.6
    assert (probe_scores(learned, answers, seen).argmax(axis=1) == right).mean() > 0.85


def test_a_submission_holds_the_answers_of_the_features(truths, train_questions, tmp_path):
    with open_questions(truths.iqtt) as file:
        count = len(file)
    rng = np.random.default_rng(0)
    np.save(tmp_path / "f.npy", rng.normal(size=(count, 4, 5)).astype("f4"))
    arguments = ["baseline", "features", "--data", truths.iqtt, "--out", tmp_path / "a.h5"]
    arguments += ["--features", tmp_path / "f.npy"]
    assert CliRunner().invoke(bench, list(map(str, arguments))).exit_code == 0
    with h5py.File(tmp_path / "a.h5") as file, open_questions(truths.iqtt) as questions:
        expected = cosines_with_reference(read_features(tmp_path / "f.npy", count, questions))
        np.testing.assert_allclose(file["scores"][()], expected)
    assert CliRunner().invoke(bench, list(map(str, arguments[:-2]))).exit_code == 2
    with refused(SpecError, "labels", "3"):
        how = {"train": train_questions, "train_features": tmp_path / "f.npy"}
        write_features(truths.iqtt, tmp_path / "b.h5", tmp_path / "f.npy", **how)
    with refused(SpecError, "train_features"):
        write_features(truths.iqtt, tmp_path / "b.h5", tmp_path / "f.npy", train=train_questions)


@pytest.mark.parametrize(
    "values",
    [
        np.zeros((5, 4, 3)),  # one question too few
        np.zeros((6, 3, 3)),
        np.zeros((6, 4, 0)),
        np.zeros(24),
        np.full((6, 4, 3), np.nan),
    ],
)
def test_features_that_do_not_fit_are_refused(values: np.ndarray, truths, tmp_path: Path):
    np.save(tmp_path / "f.npy", values)
    with open_questions(truths.iqtt) as questions, pytest.raises(SceneGenError):
        read_features(tmp_path / "f.npy", 6, questions)


def test_a_probe_needs_features_of_its_own_data(truths, train_questions, tmp_path, monkeypatch):
    monkeypatch.setattr("baselines.features.FOLDS", 1)
    for name, width in {"f.npy": 5, "g.npy": 6}.items():
        np.save(tmp_path / name, np.ones((6 if width == 5 else 3, 4, width)))
    data, out = (truths.iqtt, tmp_path / "b.h5"), (tmp_path / "f.npy",)
    how = {"train": train_questions, "train_features": tmp_path / "g.npy"}
    with refused(FileFormatError, "g.npy", "6 numbers per image"):
        write_features(*data, *out, **how)
    with refused(SpecError, "labels", "7"):
        write_features(*data, *out, labels=7)
