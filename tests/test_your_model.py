"""docs/your-model.md: its programs run as they stand, and what they write can be scored."""

import json

import pytest
from page_blocks import blocks, run_block

from metrics.submissions.reader import open_predictions

BLOCKS = blocks("your-model.md")
DOORS = ("bench import --depth", "bench run my_model.py", "metrics.evaluate(")
SCORE_ANSWERS = "bench score answers.h5 --truth iqtt-split/iqtt-test-answers.h5"
BATCHES = {
    "class Rooms(Dataset)": "torch.Size([16, 3, 32, 32]) torch.Size([16, 32, 32])\n" * 4,
    "def batches": "(16, 32, 32, 3) float32 (16, 32, 32)\n" * 4,
    "load_dataset": "(16, 32, 32, 3) (16, 32, 32)\n" * 4,
}


def shorter(code):
    return code.replace("--n 32 --size 64", "--n 8 --size 32").replace("TOLD = 180", "TOLD = 1")


def test_the_programs_read_every_row_and_what_they_write_can_be_scored(tmp_path):
    """One test, so that one worker runs the page, once; with fewer and smaller rooms to score."""
    pytest.importorskip("datasets")
    printed = {
        code: run_block(language, title, shorter(code), tmp_path)
        for language, title, code in BLOCKS
    }
    for words, lines in BATCHES.items():
        assert [text for code, text in printed.items() if words in code] == [lines]
    (scored,) = [text for code, text in printed.items() if "bench validate" in code]
    assert scored.startswith("mine.h5: valid\nmine on rooms.h5: 8 images, 8 scenes ")
    ((code, reached),) = [pair for pair in printed.items() if "RoomStream" in pair[0]]
    assert len(code.splitlines()) <= 35
    assert 0 <= float(reached) < 1
    (training,) = [text for code, text in printed.items() if "metrics.evaluate(" in code]
    first, second, last = (line.split() for line in training.splitlines())
    assert float(second[2]) < float(first[2])  # half the shift has half the error
    assert float(last[0]) == pytest.approx(0.025, rel=1e-3)
    assert json.loads((tmp_path / "mine.json").read_text())["summary"]["comparable"]
    doors = (next(c for c in printed if words in c) for words in DOORS)
    assert all(len(code.splitlines()) <= 10 for code in doors)
    with open_predictions(tmp_path / "letters.h5") as found:
        assert found.answers.tolist() == [0, 1, 2] * 3
    assert "9 questions" in run_block("bash", "", SCORE_ANSWERS, tmp_path)
