"""What is asked: right answers, calibration apart from what counts, images as in the file."""

import io
import shutil

import numpy as np
import pytest
from PIL import Image
from refusals import refused

from iqtt.files.reader import NoAnswersError, QuestionsFile
from iqtt.quiz.study import UNTOLD, Study
from scenegen.common.errors import SpecError
from scenegen.rooms.preview import srgb_bytes


def test_questions_are_those_of_the_file(study, split_folder):
    path = split_folder / "iqtt-test.h5"
    with QuestionsFile(path, answers=split_folder / "iqtt-test-answers.h5") as file:
        asked = study.draw(3)
        assert [q.calibration for q in asked] == [True] + [False] * 5
        for q in asked[1:]:
            record = file[q.row]
            assert (q.right, q.angle_degrees) == (
                record.answer,
                pytest.approx(record.truth.angle_degrees),
            )
            shown = [np.asarray(Image.open(io.BytesIO(one))) for one in study.pool.images(q.row)]
            np.testing.assert_array_equal(shown, srgb_bytes(record.radiance))


def test_the_calibration_is_of_the_validation_file(study, split_folder):
    with QuestionsFile(split_folder / "iqtt-val.h5") as file:
        told = study.draw(0)[0]
        assert told.right == file[told.row].answer
        assert study.settings.calibration_fingerprint == file.fingerprint


def test_without_it_rows_are_kept_that_nobody_is_asked(split_folder, tmp_path):
    for name in ("iqtt-test.h5", "iqtt-test-answers.h5"):
        shutil.copy(split_folder / name, tmp_path / name)
    with Study(tmp_path / "iqtt-test.h5", questions=4, calibrations=2) as study:
        draws = [study.draw(participant) for participant in range(20)]
        told = {q.row for draw in draws for q in draw if q.calibration}
        asked = {q.row for draw in draws for q in draw if not q.calibration}
        assert (len(told), len(asked), told & asked) == (2, 4, set())
    with refused(SpecError, found="6", expected="at least 7"):
        Study(tmp_path / "iqtt-test.h5", questions=5, calibrations=2)
    (tmp_path / "iqtt-test-answers.h5").unlink()
    with pytest.raises(NoAnswersError):
        Study(tmp_path / "iqtt-test.h5", questions=1)


def test_released_files_and_training_files(released, split_folder):
    path = released()
    with Study(path, questions=3, calibrations=1) as study:
        assert {q.kind for q in study.draw(0)} == {UNTOLD}
        assert len(study.settings.fingerprint) == 64
    with Study(split_folder / "iqtt-train.h5", "labeled", questions=3, calibrations=1) as study:
        assert len(study.draw(0)) == 4
