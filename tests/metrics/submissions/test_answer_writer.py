"""The writer of answers: what it writes, and that it writes nothing invalid."""

import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest

from iqtt.files.reader import AnswersFile
from metrics.prediction_writer import PredictionError, RoomPredictionWriter, write_answers
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
    assert validate(path) == []
    with open_predictions(path) as found, AnswersFile(truths.iqtt.with_name(
        "iqtt-val.h5" if "val" in name else "iqtt-test-answers.h5"
    )) as truth:  # fmt: skip
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
    assert validate(tmp_path / "a.h5") == []


EYE = np.eye(3)[[0, 1, 2, 0, 1, 2]]


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({}, ["neither answer nor scores"]),
        ({"answer": [0, 1, 2]}, ["shape (3,)", "shape (6,)"]),
        ({"answer": [0.0] * 6}, ["float64", "integers"]),
        ({"answer": [True] * 6}, ["bool", "integers"]),
        ({"answer": [0, 1, 2, 3, 0, 1]}, ["such as 3", "ids 3)"]),
        ({"answer": [0, 1, 2, 0, -2, 1]}, ["such as -2", "ids 4)"]),
        ({"answer": np.array([0, 1, 2, 0, 255, 1], "u1")}, ["such as 255"]),
        ({"scores": np.zeros((6, 4))}, ["(6, 4)", "(6, 3)"]),
        ({"scores": np.zeros((6, 3), int)}, ["int64", "floats"]),
        ({"scores": EYE * [1, 1, np.nan]}, ["scores", "NaN", "ids 0, 1, 2"]),
        ({"scores": EYE, "answer": [0, 1, 2, 0, 1, 1]}, ["other than scores say", "ids 5)"]),
        ({"scores": 0 * EYE, "answer": [0] * 6}, ["other than scores say", "at 6 questions"]),
    ],
)
def test_answers_refused(truths, tmp_path, given, words):
    with pytest.raises(PredictionError) as error:
        write_answers(tmp_path / "answers.h5", truths.iqtt, method="m", **given)
    line = str(error.value)
    assert [word for word in words if word not in line] == [], line
    assert list(tmp_path.iterdir()) == []


def test_answers_to_a_training_file(truths, tmp_path):
    with pytest.raises(SceneGenError, match="labeled or unlabeled"):
        write_answers(tmp_path / "a.h5", truths.iqtt.with_name("iqtt-train.h5"), method="m",
                      answer=[0])  # fmt: skip


def test_answers_to_no_questions(tmp_path):
    with h5py.File(tmp_path / "iqtt-val.h5", "w") as file:
        file["questions"] = np.zeros((0, 4, 32, 32, 3), "u1")
    with pytest.raises(PredictionError, match="found no questions"):
        write_answers(tmp_path / "a.h5", tmp_path / "iqtt-val.h5", method="m", answer=[])


def test_answers_keep_an_existing_file(truths, tmp_path):
    (tmp_path / "a.h5").write_text("precious")
    given = {"method": "m", "answer": [0] * 6}
    with pytest.raises(FileExistsError):
        write_answers(tmp_path / "a.h5", truths.iqtt, **given)
    write_answers(tmp_path / "a.h5", truths.iqtt, overwrite=True, **given)
    assert validate(tmp_path / "a.h5") == []


def test_a_submission_never_replaces_what_it_is_about(truths, tmp_path):
    """Not under another name of the file either."""
    for task in ("rooms", "iqtt"):
        truth = shutil.copy(truths.of(task), tmp_path / f"{task}.h5")
        before = Path(truth).read_bytes()
        link = tmp_path / f"{task}-link.h5"
        link.symlink_to(truth)
        for path in (truth, link):
            with pytest.raises(PredictionError, match="is the file that is pred"):  # noqa: PT012
                if task == "iqtt":
                    write_answers(path, truth, method="m", answer=[0] * 6, overwrite=True)
                else:
                    RoomPredictionWriter(path, truth, method="m", overwrite=True)
        assert Path(truth).read_bytes() == before
