"""No card hands out a file that tells the answers of test questions, in whatever place."""

import json
import shutil
from dataclasses import replace

import h5py
import numpy as np
import pytest
from refusals import refused

from iqtt.files.layout import FORMAT, truth_columns
from iqtt.questions.specs import SplitSpec
from iqtt.sharing.published import check_withheld, open_split
from scenegen.common.errors import SpecError
from scenegen.files.sets.shards import ROW_DIGESTS, OpenFile


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
