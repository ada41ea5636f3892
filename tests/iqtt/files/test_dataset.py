"""The map-style dataset as a training loop uses it: fields, pickles, processes."""

import os
import pickle
import subprocess
import sys

import numpy as np
import pytest

from iqtt.files.reader import QuestionsDataset, QuestionsFile, open_questions
from scenegen.common.errors import FileFormatError, SpecError

# Reads a file in other processes, after it was read here.
PROCESSES = """
import multiprocessing, sys, warnings
from iqtt.files.reader import QuestionsDataset
warnings.simplefilter("ignore", DeprecationWarning)  # 3.12 on: forking a process with threads

def total(i):
    return int(data[i]["questions"].sum()), int(data[i]["answers"])

def from_pickle(pair):
    questions, i = pair
    return int(questions[i]["questions"].sum()), int(questions[i]["answers"])

if __name__ == "__main__":
    data = QuestionsDataset(sys.argv[1], answers=sys.argv[2])
    here = [total(i) for i in range(len(data))]
    with multiprocessing.get_context("fork").Pool(3) as pool:
        for _ in range(5):
            assert pool.map(total, range(len(data)), chunksize=1) == here, "fork"
    pairs = [(data, i) for i in range(len(data))]
    with multiprocessing.get_context("spawn").Pool(2) as pool:
        assert pool.map(from_pickle, pairs, chunksize=1) == here, "spawn"
    assert [total(i) for i in range(len(data))] == here, "here again"
    print("equal", len(set(here)))
"""


def test_items(split_folder):
    path = split_folder / "iqtt-train.h5"
    data = QuestionsDataset(path, "labeled")
    with open_questions(path, "labeled") as questions:
        assert len(data) == 6
        assert (data.spec, data.fingerprint) == (questions.spec, questions.fingerprint)
        for i in (0, 5, -1):
            item = data[i]
            assert list(item) == ["questions", "answers"]
            np.testing.assert_array_equal(item["questions"], questions[i].images)
            assert item["answers"] == questions[i].answer
    for index in (6, -7):
        with pytest.raises(IndexError):
            data[index]
    assert sum(1 for _ in data) == 6, "the old iteration protocol ends at IndexError"


def test_fields_are_what_there_is(split_folder, released):
    assert QuestionsDataset(split_folder / "iqtt-train.h5", "unlabeled").fields == ("questions",)
    assert list(QuestionsDataset(released("a.h5", {"": (4, None)}))[3]) == ["questions"]
    assert list(QuestionsDataset(released("b.h5"))[3]) == ["questions", "answers"]
    path = split_folder / "iqtt-test.h5"
    data = QuestionsDataset(path, answers=split_folder / "iqtt-test-answers.h5")
    assert data.fields == ("questions", "answers")
    data = QuestionsDataset(split_folder / "iqtt-val.h5", fields=["cubes", "depth", "answers"])
    shapes = {name: values.shape for name, values in data[2].items()}
    assert shapes == {"cubes": (4, 7, 3), "depth": (4, 32, 32), "answers": ()}


def test_refusals(split_folder):
    for name, arguments, where in (
        ("iqtt-test.h5", {"fields": ("questions", "answers")}, "field"),
        ("iqtt-val.h5", {"fields": ("question",)}, "field"),
        ("iqtt-train.h5", {}, f"{split_folder / 'iqtt-train.h5'}: part"),
        ("iqtt-test-answers.h5", {}, str(split_folder / "iqtt-test-answers.h5")),
    ):
        with pytest.raises((SpecError, FileFormatError)) as error:
            QuestionsDataset(split_folder / name, **arguments)
        assert error.value.where == where


def test_pickling_after_reading(split_folder):
    data = QuestionsDataset(split_folder / "iqtt-train.h5", "unlabeled", ("questions", "cubes"))
    first = data[0]
    again = pickle.loads(pickle.dumps(data))
    assert list(again[0]) == ["questions", "cubes"]
    for name, values in again[0].items():
        np.testing.assert_array_equal(values, first[name])
    assert (again.fingerprint, len(again)) == (data.fingerprint, 6)
    assert len(pickle.dumps(data)) < 3000, "it pickles as its path"


def test_each_process_opens_the_file_once(split_folder, monkeypatch):
    opened = []
    data = QuestionsDataset(split_folder / "iqtt-val.h5")

    def counting(*arguments):
        opened.append(os.getpid())
        return QuestionsFile(*arguments)

    monkeypatch.setattr("iqtt.files.reader.QuestionsFile", counting)
    for process in (1, 1, 2, 2):
        monkeypatch.setattr("os.getpid", lambda process=process: process)
        data[0], data[1]
    assert opened == [1, 2]


def test_reading_in_several_processes(split_folder, tmp_path):
    script = tmp_path / "read.py"
    script.write_text(PROCESSES)
    paths = [str(split_folder / name) for name in ("iqtt-test.h5", "iqtt-test-answers.h5")]
    command = [sys.executable, str(script), *paths]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert done.stdout == "equal 6\n", done.stderr


@pytest.mark.slow
def test_torch_loader_with_workers(split_folder):
    torch = pytest.importorskip("torch")
    data = QuestionsDataset(split_folder / "iqtt-val.h5")
    data[0]  # open here, before the workers are forked
    loader = torch.utils.data.DataLoader(data, batch_size=4, num_workers=2)
    images = torch.cat([batch["questions"] for batch in loader])
    with open_questions(split_folder / "iqtt-val.h5") as questions:
        np.testing.assert_array_equal(images.numpy(), questions.read("questions", slice(0, 6)))
