"""Answers as a stranger hands them in: with plain h5py, or as JSON."""

import hashlib
import json

import h5py
import numpy as np
import pytest
from submissions import as_json, edited, good_answers

from metrics.submissions.reader import QuestionPredictions, open_predictions
from scenegen.common.errors import FileFormatError


def test_answers_and_scores(truths, tmp_path):
    with open_predictions(good_answers(tmp_path, truths.iqtt)) as found:
        assert isinstance(found, QuestionPredictions)
        assert found.task == "iqtt"
        assert found.rows.tolist() == list(range(6))
        assert found.answers.dtype == np.int64
        assert found.answers.tolist() == [0, 1, 2, 2, 1, 0]
        assert found.scores.dtype == np.float64
        assert found.scores.argmax(axis=1).tolist() == found.answers.tolist()


def test_answers_from_scores_abstain_where_tied(truths, tmp_path):
    def edit(file):
        del file["answer"]
        file["scores"][1] = [2.0, 5.0, 5.0]
        file["scores"][2] = [0.0, 0.0, 0.0]

    with open_predictions(edited(edit, good_answers)(tmp_path, truths.iqtt)) as found:
        assert found.answers.tolist() == [0, -1, -1, 2, 1, 0]


def test_answers_alone(truths, tmp_path):
    def edit(file):
        del file["scores"]
        file["answer"][0] = -1
        file["question"][...] = [5, 4, 3, 2, 1, 0]

    with open_predictions(edited(edit, good_answers)(tmp_path, truths.iqtt)) as found:
        assert found.answers.tolist() == [-1, 1, 2, 2, 1, 0]
        assert found.rows.tolist() == [5, 4, 3, 2, 1, 0]
        assert found.scores is None


@pytest.mark.parametrize("count", [3, 65_536, 70_001])
def test_scores_are_read_in_blocks(count, tmp_path):
    rng = np.random.default_rng(count)
    scores = rng.random((count, 3))
    path = tmp_path / "many.h5"
    with h5py.File(path, "w") as file:
        file.attrs.update(
            format="pix2shape-bench/predictions", format_version="1.0", task="iqtt",
            method="m", truth_fingerprint="",
        )  # fmt: skip
        file["question"], file["scores"] = np.arange(count), scores
    with open_predictions(path) as found:
        assert np.array_equal(found.answers, scores.argmax(axis=1))
        assert found.truth_fingerprint is None
    with h5py.File(path, "r+") as file:
        file["scores"][count - 1, 1] = np.nan
    with pytest.raises(FileFormatError, match=rf"scores: NaN.*ids {count - 1}\)"):
        open_predictions(path)


@pytest.mark.parametrize(
    ("content", "rows", "answers", "method", "run"),
    [
        ([0, 1, 2, -1], [0, 1, 2, 3], [0, 1, 2, -1], "answers", ""),
        ({"3": 1, "0": -1}, [3, 0], [1, -1], "answers", ""),
        ({"answers": [2, 2]}, [0, 1], [2, 2], "answers", ""),
        ({"answers": {"1": 0}, "method": "大", "run": "4"}, [1], [0], "大", "4"),
        ({"method": "m", "notes": "x", "answers": [0]}, [0], [0], "m", ""),
    ],
)
def test_json(tmp_path, content, rows, answers, method, run):
    path = as_json(content)(tmp_path, None)
    with open_predictions(path) as found:
        assert isinstance(found, QuestionPredictions)
        assert (found.rows.tolist(), found.answers.tolist()) == (rows, answers)
        assert (found.method, found.run) == (method, run)
        assert found.truth_fingerprint is None
        assert found.scores is None
        assert found.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()


@pytest.mark.parametrize("start", ["", "\ufeff", " \n\t"])
@pytest.mark.parametrize("name", ["answers.json", "answers", "answers.h5"])
def test_json_under_any_name(tmp_path, name, start):
    path = tmp_path / name
    path.write_text(start + json.dumps([0, 1]), encoding="utf-8")
    with open_predictions(path) as found:
        assert found.answers.tolist() == [0, 1]


def test_hdf5_under_the_name_of_json(truths, tmp_path):
    path = good_answers(tmp_path, truths.iqtt).rename(tmp_path / "answers.json")
    with open_predictions(path) as found:
        assert found.method == "guess"
