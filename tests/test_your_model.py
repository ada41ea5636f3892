"""docs/your-model.md: its programs run as they stand, and what they write can be scored."""

import json

import pytest
from page_blocks import blocks, page, run_block

BLOCKS = blocks(page("your-model.md"))
SPLIT = "iqtt make-split --size 32 --train 6 --labeled 3 --val 3 --test 9 --out iqtt-split"


@pytest.fixture(scope="module")
def printed(tmp_path_factory):
    """Run the page once; return what each block printed, by its first words, and the folder."""
    pytest.importorskip("datasets")
    folder = tmp_path_factory.mktemp("model")
    run_block("bash", "", SPLIT, folder)
    return [run_block(*block, folder) for block in BLOCKS], folder


def of(printed, words):
    (text,) = [ran for ran, block in zip(printed[0], BLOCKS, strict=True) if words in block[2]]
    return text


def test_workers_read_every_row(printed):
    lines = "torch.Size([16, 3, 32, 32]) torch.Size([16, 32, 32])\n" * 4
    assert of(printed, "class Rooms(Dataset)") == lines


def test_plain_batches_have_every_row(printed):
    assert of(printed, "def batches") == "(16, 32, 32, 3) float32 (16, 32, 32)\n" * 4


def test_datasets_reads_the_export(printed):
    assert of(printed, "load_dataset") == "(16, 32, 32, 3) (16, 32, 32)\n" * 4


def test_predictions_are_valid_and_scored(printed):
    assert of(printed, "bench validate").startswith("mine.h5: valid\nmine: 32 images of 32 scenes")
    assert json.loads((printed[1] / "mine.json").read_text())["comparable"]


def test_answers_are_valid_and_scored(printed):
    score = "bench score answers.h5 --truth iqtt-split/iqtt-test-answers.h5"
    assert "9 questions" in run_block("bash", "", score, printed[1])
