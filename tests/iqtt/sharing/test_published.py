"""Which files of a split are handed out; none tells the answers of test questions."""

import json
import shutil
from dataclasses import replace

import h5py
import numpy as np
import pytest
from refusals import refused

from iqtt.files.layout import FORMAT, truth_columns
from iqtt.files.verify import verify_split
from iqtt.questions.specs import SplitSpec
from iqtt.sharing.published import check_withheld, handed_out, open_split
from scenegen.common.errors import FileFormatError, SpecError
from scenegen.files.sets.shards import ROW_DIGESTS, OpenFile

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


def seeded(file):
    spec = replace(SplitSpec.from_json(file.attrs["spec"]), seed=5)
    file.attrs["spec"] = spec.to_json()


def of_another(file):
    del file[ROW_DIGESTS]
    file[ROW_DIGESTS] = np.zeros((len(file["questions"]), 2, 32), np.uint8)
    file[ROW_DIGESTS].attrs["names"] = ["answers", "questions"]


LEAKS = {
    "answers": lambda file: file.create_dataset("answers", data=np.zeros(6, np.uint8)),
    "truth": lambda file: file.create_group("truth"),
    "key": lambda file: file.create_dataset("key", data=[1]),
    "attribute truth_digest": lambda file: file.attrs.update(truth_digest="0" * 64),
    "attribute key": lambda file: file.attrs.update(key=[0, 1, 2]),
    "questions@key": lambda file: file["questions"].attrs.update(key=[0, 1, 2]),
    ROW_DIGESTS: of_another,
    f"{ROW_DIGESTS}: attribute 'names'": lambda f: f[ROW_DIGESTS].attrs.update(names=["0121"]),
    "the seed": seeded,
    "the command": lambda file: file.attrs.update(creation_command="iqtt make-split --seed 5"),
}
OF_ANY = ("the seed", "the command")  # which no file of the split may tell
WHOLE, SHARD = "iqtt-test.h5", "iqtt-test-00001-of-00002.h5"


@pytest.mark.parametrize(
    ("name", "leak"),
    [(SHARD, leak) for leak in LEAKS]
    + [(WHOLE, leak) for leak in LEAKS if ROW_DIGESTS not in leak],
)
def test_a_file_that_tells_more_is_refused(name, leak, splits, tmp_path):
    folder = tmp_path / "split"
    shutil.copytree(splits["whole" if name == WHOLE else "shards"], folder)
    with OpenFile(folder / name, FORMAT.kind) as opened:
        check_withheld(opened, is_test=True)
    with h5py.File(folder / name, "r+") as file:
        LEAKS[leak](file)
    with refused(SpecError, str(folder / name), leak), open_split(folder):
        pass


@pytest.mark.parametrize("leak", OF_ANY)
@pytest.mark.parametrize("name", ["iqtt-train-00000-of-00003.h5", "iqtt-val.h5"])
def test_no_file_may_tell_how_to_make_the_answers_again(leak, name, splits, tmp_path):
    folder = tmp_path / "split"
    shutil.copytree(splits["shards"], folder)
    with h5py.File(folder / name, "r+") as file:
        LEAKS[leak](file)
    with refused(SpecError, found=leak), open_split(folder):
        pass


def test_a_file_of_answers_is_none_of_questions(splits):
    path = splits["whole"] / "iqtt-test-answers.h5"
    with h5py.File(path) as file:
        told = {column.name for column in truth_columns(SplitSpec.from_json(file.attrs["spec"]))}
        assert told == set(file["truth"])
        assert json.loads(file.attrs["spec"])["seed"] == 5
    with pytest.raises(SpecError), OpenFile(path, FORMAT.kind) as opened:
        check_withheld(opened, is_test=True)
