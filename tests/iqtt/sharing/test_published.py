"""Which files of a split are handed out, and which folders are none of a split."""

import shutil

import h5py
import pytest
from refusals import refused

from iqtt.files.verify import verify_split
from iqtt.sharing.published import published_split
from scenegen.common.errors import FileFormatError

PUBLIC = [
    "iqtt-train.h5", *(f"iqtt-train-0000{i}-of-00003.h5" for i in range(3)), "iqtt-val.h5",
    "iqtt-test.h5", "iqtt-test-00000-of-00002.h5", "iqtt-test-00001-of-00002.h5",
]  # fmt: skip
ANSWERS = [
    "iqtt-test-answers.h5", "iqtt-test-answers-00000-of-00002.h5",
    "iqtt-test-answers-00001-of-00002.h5", "iqtt.manifest.json",
]  # fmt: skip


def test_files_and_tables(splits, tmp_path):
    found = published_split(splits["shards"])
    assert [path.name for path, _ in found.files] == PUBLIC
    assert [path.name for path, _ in published_split(splits["shards"], True).files] == [
        *PUBLIC, *ANSWERS
    ]  # fmt: skip
    assert [(table.name, table.count) for table in found.tables] == [
        ("iqtt-train.h5 labeled", 5), ("iqtt-train.h5 unlabeled", 4), ("iqtt-val.h5", 2),
        ("iqtt-test.h5", 6),
    ]  # fmt: skip
    assert (found.count, found.answers) == (17, None)
    for path, _ in found.files:
        shutil.copy(path, tmp_path)
    assert all(check.ok for check in verify_split(tmp_path)), "what is handed out is whole"
    assert published_split(tmp_path).count == 17


def test_no_split(splits, released, tmp_path):
    with pytest.raises(FileNotFoundError):
        published_split(tmp_path)
    released("iqtt-val.h5")
    with refused(FileFormatError, found="no attribute 'format'"):
        published_split(tmp_path)
    shutil.copy(splits["whole"] / "iqtt-test.h5", tmp_path / "iqtt-val.h5")
    with refused(FileFormatError, found="questions for test", expected="val"):
        published_split(tmp_path)
    with pytest.raises(FileNotFoundError):
        published_split(tmp_path, with_answers=True)


def test_answers_of_other_questions_are_refused(splits, tmp_path):
    shutil.copytree(splits["whole"], tmp_path / "split")
    with h5py.File(tmp_path / "split" / "iqtt-test-answers.h5", "r+") as file:
        file.attrs["fingerprint"] = "0" * 64
    with pytest.raises(FileFormatError):
        published_split(tmp_path / "split", with_answers=True)
    published_split(tmp_path / "split")
