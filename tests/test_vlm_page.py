"""The page on vision-language models, run in an empty folder as a reader runs it."""

import pytest
from page_blocks import blocks, run_block


@pytest.mark.slow
def test_the_page_runs(tmp_path):
    def smaller(code):
        return code.replace("--size 256", "--size 64").replace("--train 10", "--train 10 --size 64")

    printed = [
        run_block(language, title, smaller(code), tmp_path)
        for language, title, code in blocks("vlm.md")
        if language != "json"
    ]
    rows = dict(line.split()[:2] for line in printed[1].splitlines() if len(line.split()) == 2)
    assert float(rows["circular_accuracy"]) == 0.0
    assert 0 <= float(rows["accuracy"]) <= 0.7
