"""Exports, read by the loaders that people use, and cards: what they tell, and what they do not."""

import hashlib
import json
import shutil

import h5py
import numpy as np
import pytest

from iqtt import open_questions
from iqtt.sharing.published import open_split
from iqtt.sharing.questions import QUESTIONS, write_questions_card
from scenegen.rooms.export.formats import DATA_FORMATS
from scenegen.sharing.card import Publication
from scenegen.sharing.export import ABOUT, write_export
from tests.support.loaders import VALUES, check_srgb

TABLES = (("train", "labeled"), ("train", "unlabeled"), ("val", None), ("test", None))


def export_questions(path, form, folder, part=None, **how):
    with open_questions(path, part) as questions:
        return write_export(questions, QUESTIONS, form, folder, **how)


def check_rows(found, questions, value):
    """Compare all that the file tells with what was loaded; pictures are sRGB."""
    assert len(found) == len(questions) > 0
    for row, values in enumerate(found):
        images = ["reference", *(f"answer_{i}" for i in range(questions.answers))]
        for name, stored in zip(images, questions.read("questions", row), strict=True):
            read = np.asarray(value(values, name))
            if stored.dtype == np.uint8:
                check_srgb(read.astype(float), stored / 255)
            else:
                np.testing.assert_array_equal(read.astype(stored.dtype), stored)
        for name in set(questions.fields) - {"questions"}:
            stored = np.asarray(questions.read(name, row))
            read = value(values, "answer" if name == "answers" else name)
            np.testing.assert_array_equal(np.asarray(read).astype(stored.dtype), stored, name)


@pytest.mark.parametrize(
    ("kind", "form"), [("whole", "parquet"), ("shards", "webdataset"), ("floats", "parquet")]
)
def test_everything_is_there(kind, form, splits, load, tmp_path):
    for split, part in TABLES:
        path = splits[kind] / f"iqtt-{split}.h5"
        made = export_questions(path, form, tmp_path / f"{split}{part}", part, rows_per_file=4)
        loaded = load(form, data_files=[str(p) for p in made if p.name != ABOUT])
        with open_questions(path, part) as questions:
            check_rows(loaded, questions, VALUES[form])
            told = {"answer", "angle_degrees"} & set(loaded.features if form == "parquet"
                                                     else loaded[0]["json"])  # fmt: skip
            assert ("answer" in told, "angle_degrees" in told) == (
                split == "val" or part == "labeled", split != "test"
            )  # fmt: skip
        if form == "parquet":
            picture = type(loaded.features["answer_1"]).__name__
            assert picture == ("Array3D" if kind == "floats" else "Image")


def test_released_files(released, load, tmp_path):
    path = released(tables={"labeled": (3, [2, 0, 1]), "unlabeled": (2, None)})
    for part in ("labeled", "unlabeled"):
        made = export_questions(path, "parquet", tmp_path / part, part)
        loaded = load("parquet", data_files=[str(made[0])])
        with open_questions(path, part) as questions:
            check_rows(loaded, questions, VALUES["parquet"])


@pytest.mark.parametrize("form", DATA_FORMATS)
def test_nothing_of_the_answers_beside_a_test_file_is_written(form, splits, tmp_path):
    """An export is the same where the file of the answers is not there."""
    (tmp_path / "alone").mkdir()
    shutil.copy(splits["whole"] / "iqtt-test.h5", tmp_path / "alone")
    for name, folder in (("beside", splits["whole"]), ("without", tmp_path / "alone")):
        export_questions(folder / "iqtt-test.h5", form, tmp_path / name)
    files = {p.name: p.read_bytes() for p in (tmp_path / "beside").iterdir()}
    assert files == {p.name: p.read_bytes() for p in (tmp_path / "without").iterdir()}
    columns = json.loads(files[ABOUT])["columns"]
    assert list(columns) == ["row", "reference", "answer_0", "answer_1", "answer_2"]


TOLD = Publication("Some questions", ("A. Person",), "CC-BY-4.0")


def make_card(folder, path, with_answers=False):
    with open_split(folder, with_answers) as tables:
        write_questions_card(path, tables, TOLD)
    return path.read_text()


@pytest.mark.parametrize("kind", ["whole", "shards", "floats"])
def test_nothing_is_told_of_the_test_answers(kind, splits, tmp_path):
    """The card is the same where the file of the answers is not there."""
    private = [*splits[kind].glob("iqtt-test-answers*")]
    public = tmp_path / "public"
    shutil.copytree(splits[kind], public, ignore=lambda *_: [path.name for path in private])
    page = make_card(splits[kind], tmp_path / "README.md")
    assert page == make_card(public, tmp_path / "same.md")
    with h5py.File(splits[kind] / "iqtt-test-answers.h5") as file:
        seed, command = json.loads(file.attrs["spec"])["seed"], file.attrs["creation_command"]
    digests = [hashlib.sha256(p.read_bytes()).hexdigest() for p in private if p.exists()]
    assert not [text for text in (command, *digests) if text in page]
    assert kind != "shards" or str(seed) not in page
    assert "is held out" in page
    assert "iqtt-test-answers" not in page
