"""Which files of a split are handed out, and which folders are none of a split."""

import shutil

import h5py
import pytest
from refusals import refused

from iqtt.files.verify import verify_split
from iqtt.sharing.published import handed_out, open_split
from scenegen.common.errors import FileFormatError

PUBLIC = [
    "iqtt-train.h5", *(f"iqtt-train-0000{i}-of-00003.h5" for i in range(3)), "iqtt-val.h5",
    "iqtt-test.h5", "iqtt-test-00000-of-00002.h5", "iqtt-test-00001-of-00002.h5",
]  # fmt: skip
ANSWERS = [
    "iqtt-test-answers.h5", "iqtt-test-answers-00000-of-00002.h5",
    "iqtt-test-answers-00001-of-00002.h5",
]  # fmt: skip


def names_of(folder, with_answers=False):
    with open_split(folder, with_answers) as tables:
        return [path.name for path, _ in handed_out(tables)]


def test_files_and_tables(splits, tmp_path):
    assert names_of(splits["shards"]) == PUBLIC
    assert names_of(splits["shards"], True) == [*PUBLIC, *ANSWERS]
    with open_split(splits["shards"]) as tables:
        assert [(table.path.name, table.part, len(table)) for table in tables] == [
            ("iqtt-train.h5", "labeled", 5), ("iqtt-train.h5", "unlabeled", 4),
            ("iqtt-val.h5", "", 2), ("iqtt-test.h5", "", 6),
        ]  # fmt: skip
        assert {table.beside for table in tables} == {None}
        for path, _ in handed_out(tables):
            shutil.copy(path, tmp_path)
    assert not any(table.opened.is_open for table in tables)
    assert all(check.ok for check in verify_split(tmp_path)), "what is handed out is whole"
    assert names_of(tmp_path) == PUBLIC


def refuses_split(folder, error, with_answers=False, **told):
    with refused(error, **told), open_split(folder, with_answers):
        pass


def test_no_split(splits, released, tmp_path):
    with pytest.raises(FileNotFoundError), open_split(tmp_path):
        pass
    released("iqtt-val.h5")
    refuses_split(tmp_path, FileFormatError, found="no attribute 'format'")
    shutil.copy(splits["whole"] / "iqtt-test.h5", tmp_path / "iqtt-val.h5")
    refuses_split(tmp_path, FileFormatError, found="questions for test", expected="val")
    with pytest.raises(FileNotFoundError), open_split(tmp_path, with_answers=True):
        pass


def test_answers_of_other_questions_are_refused(splits, tmp_path):
    shutil.copytree(splits["whole"], tmp_path / "split")
    with h5py.File(tmp_path / "split" / "iqtt-test-answers.h5", "r+") as file:
        file.attrs["fingerprint"] = "0" * 64
    refuses_split(tmp_path / "split", FileFormatError, with_answers=True)
    names_of(tmp_path / "split")
