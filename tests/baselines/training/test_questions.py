"""Questions as every baseline reads them: which files suit, and one function of each."""

from pathlib import Path

import pytest
from pix2shape_models import released
from refusals import refused

from baselines.training.data import TrainingFiles
from baselines.training.questions import LABELED, UNLABELED, is_question_file, open_test
from scenegen.common.errors import FileFormatError, SpecError


def test_rooms_are_told_from_questions(rooms_path, truths, train_questions, tmp_path):
    assert not is_question_file(rooms_path)
    own = Path(truths.iqtt)
    for path in (own, train_questions, own.with_name("iqtt-test-answers.h5")):
        assert is_question_file(path)
    assert is_question_file(released(tmp_path / "released.h5", [0]))
    (tmp_path / "text.h5").write_text("text")
    with pytest.raises(FileFormatError) as error:
        is_question_file(tmp_path / "text.h5")
    assert error.value.where.startswith(str(tmp_path / "text.h5"))


def test_training_questions_are_told_from_those_to_answer(truths, train_questions):
    for part in (LABELED, UNLABELED):
        with TrainingFiles(train_questions) as files:
            (questions,) = files.questions(part)
            assert (questions.part, len(questions)) == (part, 3)
        with TrainingFiles(truths.iqtt) as files, refused(SpecError, "iqtt-test.h5", "no training"):
            files.questions(part)
    with open_test(truths.iqtt, 16) as questions:
        assert len(questions) == 6
    with refused(SpecError, "iqtt-train.h5", "training questions"):
        open_test(train_questions, 16)
    with refused(SpecError, "iqtt-test.h5", "32x32", "24"):
        open_test(truths.iqtt, 24)
