"""A split's data card as its readers see it; above all, what it does not tell them."""

import hashlib
import json
import shutil

import h5py
import numpy as np
import pyarrow.parquet as pq
import pytest

from iqtt import open_questions
from iqtt.sharing.published import open_split
from iqtt.sharing.questions import QUESTIONS, make_questions_card
from scenegen.files.content import row_digest
from scenegen.sharing.card import NAMES
from scenegen.sharing.index import index_columns
from tests.support.loaders import faultless_croissant

TRUTH = ("answer", "cube_count", "camera_distance", "angle_degrees", "distractor_kinds")


def make_card(folder, card, publication, with_answers=False):
    with open_split(folder, with_answers) as tables:
        make_questions_card(tables, card, publication)


@pytest.fixture(scope="module")
def cards(splits, publication, tmp_path_factory):
    """Return the folders of cards of splits, by the split and whether answers are handed out."""
    home, made = tmp_path_factory.mktemp("cards"), {}
    for name in splits:
        for answers in (False, True):
            made[name, answers] = home / f"{name}-{answers}"
            make_card(splits[name], made[name, answers], publication, answers)
    return made


@pytest.fixture(params=["whole", "shards", "floats"])
def kind(request):
    return request.param


def test_nothing_is_told_of_the_test_answers(kind, cards, splits, publication, tmp_path):
    """The card is the same where the file of the answers is not there; none of its truth shows."""
    private = [*splits[kind].glob("iqtt-test-answers*")]
    public = tmp_path / "public"
    shutil.copytree(splits[kind], public, ignore=lambda *_: [path.name for path in private])
    make_card(public, tmp_path / "card", publication)
    with h5py.File(splits[kind] / "iqtt-test-answers.h5") as file:
        seed, command = json.loads(file.attrs["spec"])["seed"], file.attrs["creation_command"]
    digests = [hashlib.sha256(p.read_bytes()).hexdigest() for p in private if p.exists()]
    for name in NAMES:
        told = (cards[kind, False] / name).read_bytes()
        assert told == (tmp_path / "card" / name).read_bytes()
        assert not [text for text in (command, *digests) if text.encode() in told]
    for name in NAMES[:2]:
        told = (cards[kind, False] / name).read_text()
        assert "iqtt-test-answers" not in told
        assert kind != "shards" or str(seed) not in told
    lines = pq.read_table(cards[kind, False] / "index.parquet").to_pylist()
    of_test = [line for line in lines if line["split"] == "test"]
    assert len(of_test) > 0
    assert {line[name] for line in of_test for name in TRUTH} == {None}
    assert "are not part of this data" in (cards[kind, False] / "README.md").read_text()


@pytest.mark.filterwarnings("ignore:The inplace keyword")  # of pandas, in mlcroissant
@pytest.mark.parametrize("answers", [False, True])
def test_records_are_the_questions(kind, answers, cards, splits):
    """Values as mlcroissant reads them from the index, beside those of the question files."""
    found = faultless_croissant(cards[kind, answers] / "croissant.json")
    assert found.metadata.name == "some-questions"
    files = {file.name for file in found.metadata.file_objects}
    assert ("iqtt-test-answers.h5" in files) == answers
    keys = set()
    for record in found.records("rows"):
        line = {key.removeprefix("rows/"): texts(value) for key, value in record.items()}
        assert set(line) == {c.name for c in index_columns(QUESTIONS)}
        keys.add((line["file"], line["part"], line["row"]))
        beside = splits[kind] / "iqtt-test-answers.h5"
        with_key = answers and line["split"] == "test"
        path = splits[kind] / line["file"]
        with open_questions(path, line["part"] or None, beside if with_key else None) as file:
            question = file[line["row"]]
        assert line["answer"] == question.answer
        assert line["questions_sha256"] == row_digest(question.images).hex()
        assert line["answer_count"] == len(question.images) - 1
        truth = question.truth
        if truth is None:
            assert [line[name] for name in TRUTH] == [None] * 5
        else:
            assert line["cube_count"] == truth.cubes.shape[1]
            assert line["angle_degrees"] == truth.angle_degrees
            assert line["camera_distance"] == truth.camera.world_from_camera[2, 3]
            assert line["distractor_kinds"] == [k for k in truth.distractor_kind if k]
        with h5py.File(splits[kind] / line["shard"]) as shard:
            images = shard[f"{line['part']}/questions"][line["shard_row"]]
        np.testing.assert_array_equal(images, question.images)
    assert len(keys) == {"whole": 24, "shards": 17, "floats": 7}[kind]


def texts(value):
    if isinstance(value, list):
        return [texts(part) for part in value]
    return value.decode() if isinstance(value, bytes) else value


def test_the_page(cards, load):
    page = (cards["whole", False] / "README.md").read_text()
    titles = {line[3:] for line in page.splitlines() if line.startswith("## ")}
    assert {"Intended use", "Limits", "Known biases", "Splits", "Test answers"} < titles
    assert "Commands" not in titles
    assert "| questions | 6 | 6 | 6 | 6 |" in page
    assert (
        "| right answers by place | 0: 2, 1: 2, 2: 2 | not told | 0: 2, 1: 2, 2: 2 | not told |"
        in page
    )
    page = (cards["shards", True] / "README.md").read_text()
    assert "    iqtt --seed 8123456789012345" in page.splitlines()
    assert "are part of this data" in page
    assert len(load(str(cards["whole", False]), "index")) == 24


def test_questions_that_are_there_twice_are_told(splits, publication, tmp_path):
    shutil.copytree(splits["whole"], tmp_path / "split")
    with h5py.File(tmp_path / "split" / "iqtt-val.h5", "r+") as file:
        file["questions"][3] = file["questions"][1]
        rows = [row_digest(row) for row in file["questions"]]
        file["questions"].attrs["sha256"] = hashlib.sha256(b"".join(rows)).hexdigest()
    make_card(tmp_path / "split", tmp_path / "card", publication)
    page = (tmp_path / "card" / "README.md").read_text()
    assert "**1 questions have the images of another one.**" in page
