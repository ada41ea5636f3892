"""The writer of answers to questions: what it writes, and what it refuses."""

import h5py
import numpy as np
import pytest
from refusals import refused

from iqtt.files.reader import AnswersFile
from metrics.prediction_writer import PredictionError, write_answers
from metrics.submissions.reader import open_predictions
from metrics.submissions.validation import validate
from scenegen.common.errors import SceneGenError


@pytest.mark.parametrize("name", ["iqtt-test.h5", "iqtt-test-answers.h5", "iqtt-val.h5"])
def test_answers(truths, tmp_path, name):
    file = truths.iqtt.with_name(name)
    scores = np.random.default_rng(3).random((6, 3)) + 1.0
    answer = scores.argmax(axis=1).tolist()
    path = tmp_path / "answers.h5"
    write_answers(path, file, method="m", run="1", notes="n", answer=answer, scores=scores)
    assert validate(path, file) == []
    truth_name = "iqtt-val.h5" if "val" in name else "iqtt-test-answers.h5"
    with open_predictions(path) as found, AnswersFile(file.with_name(truth_name)) as truth:
        assert found.rows.tolist() == list(range(6))
        assert found.answers.tolist() == answer
        assert np.array_equal(found.scores, scores)
        assert (found.method, found.run, found.notes) == ("m", "1", "n")
        assert found.truth_path == str(file)
        assert found.truth_fingerprint == truth.fingerprint
    with h5py.File(path) as stored:
        assert set(stored) == {"question", "answer", "scores"}
        assert all(stored[n].attrs["meaning"] and stored[n].attrs["unit"] for n in stored)


def test_answers_to_a_file_as_released(truths, tmp_path):
    """It has no fingerprint, so that only the number of questions is held against it."""
    file = tmp_path / "iqtt-val.h5"
    with h5py.File(truths.iqtt.with_name("iqtt-val.h5")) as ours, h5py.File(file, "w") as released:
        released["questions"], released["answers"] = ours["questions"][()], ours["answers"][()]
    write_answers(tmp_path / "a.h5", file, method="m", answer=[0, 1, 2, -1, 0, 1])
    with open_predictions(tmp_path / "a.h5") as found:
        assert found.truth_fingerprint is None
        assert found.answers.tolist() == [0, 1, 2, -1, 0, 1]
    assert validate(tmp_path / "a.h5", file) == []


EYE = np.eye(3)[[0, 1, 2, 0, 1, 2]]


@pytest.mark.parametrize(
    ("given", "where", "found"),
    [
        ({}, "", "neither answer nor scores"),
        ({"answer": [0, 1, 2]}, ": answer", "shape (3,)"),
        ({"answer": [0.0] * 6}, ": answer", "float64"),
        ({"answer": [True] * 6}, ": answer", "bool"),
        ({"answer": [0, 1, 2, 3, 0, 1]}, ": answer", "such as 3 (ids 3)"),
        ({"answer": [0, 1, 2, 0, -2, 1]}, ": answer", "such as -2 (ids 4)"),
        ({"answer": np.array([0, 1, 2, 0, 255, 1], "u1")}, ": answer", "such as 255"),
        ({"scores": np.zeros((6, 4))}, ": scores", "(6, 4)"),
        ({"scores": np.zeros((6, 3), int)}, ": scores", "int64"),
        ({"scores": EYE * [1, 1, np.nan]}, ": scores", "(ids 0, 1, 2"),
        ({"scores": EYE, "answer": [0, 1, 2, 0, 1, 1]}, ": answer", "(ids 5)"),
        ({"scores": 0 * EYE, "answer": [0] * 6}, ": answer", "at 6 questions"),
    ],
)
def test_answers_refused(truths, tmp_path, given, where, found):
    with refused(PredictionError, f"{tmp_path / 'answers.h5'}{where}", found=found):
        write_answers(tmp_path / "answers.h5", truths.iqtt, method="m", **given)
    assert list(tmp_path.iterdir()) == []


def test_answers_to_no_questions(truths, tmp_path):
    training = truths.iqtt.with_name("iqtt-train.h5")
    with pytest.raises(SceneGenError):
        write_answers(tmp_path / "a.h5", training, method="m", answer=[0])
    with h5py.File(tmp_path / "iqtt-val.h5", "w") as file:
        file["questions"] = np.zeros((0, 4, 32, 32, 3), "u1")
    with refused(PredictionError, found="no questions"):
        write_answers(tmp_path / "a.h5", tmp_path / "iqtt-val.h5", method="m", answer=[])


def test_answers_keep_an_existing_file(truths, tmp_path):
    (tmp_path / "a.h5").write_text("precious")
    given = {"method": "m", "answer": [0] * 6}
    with pytest.raises(FileExistsError):
        write_answers(tmp_path / "a.h5", truths.iqtt, **given)
    write_answers(tmp_path / "a.h5", truths.iqtt, overwrite=True, **given)
    assert validate(tmp_path / "a.h5", truths.iqtt) == []
