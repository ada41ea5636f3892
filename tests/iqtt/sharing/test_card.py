"""A split's data card as its readers see it; above all, what it does not tell them."""

import hashlib
import json
import shutil

import h5py
import pytest

from iqtt.sharing.published import open_split
from iqtt.sharing.questions import write_questions_card
from scenegen.sharing.card import Publication

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
    assert "are not part of this data" in page
    assert "iqtt-test-answers" not in page


def test_with_answers_everything_is_told(splits, tmp_path):
    page = make_card(splits["shards"], tmp_path / "README.md", True)
    assert "    iqtt --seed 8123456789012345" in page.splitlines()
    assert "are part of this data" in page
    for name in ("iqtt-test-answers.h5",):
        data = (splits["shards"] / name).read_bytes()
        assert f"| {name} | {len(data)} | {hashlib.sha256(data).hexdigest()} |" in page


def test_tables_and_files(splits, tmp_path):
    page = make_card(splits["whole"], tmp_path / "README.md")
    for part in ("train.h5 | labeled | train | 6 | yes", "train.h5 | unlabeled | train | 6 | no",
                 "val.h5 |  | val | 6 | yes", "test.h5 |  | test | 6 | no"):  # fmt: skip
        assert f"| iqtt-{part} |" in page
    assert "| `truth/angle_degrees` |" in page
