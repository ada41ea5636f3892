"""Questions as every baseline reads them: which files suit, and one function of each."""

from pathlib import Path

import h5py
import numpy as np
import pytest
import torch
from pix2shape_models import released
from refusals import refused

from baselines.training.data import TrainingFiles
from baselines.training.questions import (
    LABELED,
    UNLABELED,
    check_labels,
    check_truth,
    each_question,
    is_question_file,
    open_test,
    training_answers,
)
from iqtt import SplitSpec, make_split, open_questions
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


def test_labels_and_truth_that_are_not_there_are_refused(train_questions, truths, tmp_path):
    with open_questions(train_questions, LABELED) as questions:
        check_truth(questions)
        for labels in (0, 3):
            check_labels(questions, labels)
        for labels, least in ((-1, 0), (4, 0), (0, 1)):
            with refused(SpecError, "labels", f"{labels}", f"{least} to 3"):
                check_labels(questions, labels, least)
        assert (
            training_answers(questions, 2).tolist()
            == questions.read("answers", slice(0, 2)).tolist()
        )
    with open_questions(train_questions, UNLABELED) as questions, refused(SpecError, "labels"):
        check_labels(questions, 1)
    with open_questions(truths.iqtt) as questions, refused(SpecError, "iqtt-test.h5", "without"):
        check_truth(questions)
    size = {"height": 32, "width": 32, "min_cube_pixels": 0}
    make_split(tmp_path / "split", SplitSpec(train=1, labeled=0, val=0, test=0, **size))
    with open_questions(tmp_path / "split" / "iqtt-train.h5", LABELED) as questions:
        with refused(SpecError, "labels", "0", "1 to 0", "--labeled"):
            check_labels(questions, 0, 1)
        with refused(SpecError, "iqtt-train.h5", "0 questions"):
            check_truth(questions)


@pytest.mark.parametrize("batch", [1, 4, 9])
def test_each_question_is_seen_once_in_the_files_order(batch, truths):
    seen, done = [], []

    def corner(images: torch.Tensor) -> torch.Tensor:
        seen.append(len(images))
        return images[:, :, :, 0, 0]

    with open_questions(truths.iqtt) as questions:
        values = each_question(questions, 16, corner, batch, progress=lambda *n: done.append(n))
        assert each_question(questions, 16, corner, 9, count=2).shape == (2, 4, 3)
    with h5py.File(truths.iqtt) as file:
        corners = file["questions"][:, :, :2, :2].mean(axis=(2, 3)) / 255
    np.testing.assert_allclose(values, corners, rtol=1e-5)
    sizes = {1: [1] * 6, 4: [4, 2], 9: [6]}[batch]
    assert seen[:-1] == sizes
    assert done == [(size, 6) for size in sizes]


def test_an_image_that_is_not_finite_is_refused(tmp_path):
    path = released(tmp_path / "released.h5", [0, 1])
    with h5py.File(path, "r+") as file:
        file["questions"][1, 2, 3, 4] = np.nan
    with open_questions(path) as questions, refused(FileFormatError, f"{path}: row 1"):
        each_question(questions, 16, lambda images: images, 1)
