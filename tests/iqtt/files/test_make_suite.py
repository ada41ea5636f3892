"""The suite: a split of each kind of question, in a folder of its own, whole or not at all."""

import os
from dataclasses import replace

import h5py
import pytest
from made_splits import TINY, StopError, listing

from iqtt.files.make import make_suite
from iqtt.files.reader import QuestionsFile
from iqtt.files.shards import ALL_FILES as FILES
from iqtt.questions.specs import SUITE, question_kind
from iqtt.shapes.splits import TooFewShapesError

SUITE_SPEC = replace(TINY, cubes=(9, 9), train=2, labeled=1, val=2, test=1)


def test_the_suite_has_a_split_of_each_kind_in_a_folder_of_its_own(tmp_path):
    done: list[int] = []
    tally = make_suite(tmp_path / "suite", SUITE_SPEC, progress=done.append, compression="none")
    assert sorted(os.listdir(tmp_path / "suite")) == sorted(SUITE)
    assert (sum(done), tally.proposed > 5 * 6 * 3) == (5 * 6, True)
    for name, (kind, answers) in SUITE.items():
        with QuestionsFile(tmp_path / "suite" / name / "iqtt-val.h5") as questions:
            expected = replace(SUITE_SPEC, seed=None, distractors=kind, answers=answers)
            assert questions.spec == expected
            kinds = questions.read("distractor_kind", slice(None))
            assert {question_kind(row) for row in kinds.tolist()} == {name}
            assert questions.read("questions", 0).shape == (1 + answers, 16, 16, 3)
        with h5py.File(tmp_path / "suite" / name / "iqtt-train.h5") as file:
            assert file["unlabeled/questions"].compression is None
    with pytest.raises(FileExistsError):
        make_suite(tmp_path / "suite", SUITE_SPEC)


def test_a_suite_that_is_stopped_leaves_whole_splits_and_goes_over_none(tmp_path):
    done: list[int] = []

    def stop(count: int) -> None:
        done.append(count)
        if sum(done) > 7:
            raise StopError

    for folder in ("suite", "suite"):
        done.clear()
        with pytest.raises(StopError):
            make_suite(tmp_path / folder, SUITE_SPEC, progress=stop, overwrite=True)
        assert listing(tmp_path).keys() == {
            *("suite", "suite/matched", *(f"suite/matched/{name}" for name in FILES))
        }
    before = listing(tmp_path)
    (tmp_path / "file").write_text("mine")
    with pytest.raises(NotADirectoryError):
        make_suite(tmp_path / "file", SUITE_SPEC, progress=done.append)
    with pytest.raises(TooFewShapesError):
        make_suite(tmp_path / "new", replace(SUITE_SPEC, cubes=(6, 6)))
    with pytest.raises(FileNotFoundError):
        make_suite(tmp_path / "no" / "new", SUITE_SPEC)
    (tmp_path / "file").unlink()
    assert listing(tmp_path) == before
