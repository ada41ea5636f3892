"""docs/tutorial.md, from its first block to its last, as a reader runs them; and what it says."""

import re

import pytest
from page_blocks import BLOCK, NUMBER, blocks, near, page, run_block, told_but_not_printed

PAGE = page("tutorial.md")
DECIMAL = re.compile(r"(?<![\w.`-])-?\d\.\d+(?!\w)")
GIVEN = ("3.11", "3.13", "0.03")  # versions, and a setting


def test_the_blocks_print_what_the_page_says(tmp_path):
    """One test, so that one worker runs the page, once."""
    before, pairs = "", []
    for language, title, code in blocks(PAGE):
        if language == "text":
            pairs.append((code, before))
        elif ran := run_block(language, title, code, tmp_path):
            before = ran
    assert len(pairs) >= 6
    assert [told_but_not_printed(*pair) for pair in pairs] == [[]] * len(pairs)
    for name in ("mine.html", "leaderboard.md"):
        assert "kernel ridge" in (tmp_path / name).read_text()


def test_numbers_in_the_text_are_those_of_the_blocks():
    """Each number with a point, before those that say what other runs gave, is one rounded."""
    numbers = NUMBER.findall("".join(code for name, _, code in blocks(PAGE) if name == "text"))
    text = BLOCK.sub("", PAGE.split("## From here")[0])
    told = [number for number in DECIMAL.findall(text) if number not in GIVEN]
    assert told
    assert [x for x in told if not any(near(x, number) for number in numbers)] == []


def test_a_wrong_number_is_noticed():
    line = "  skill of chamfer  -1.2562  [-1.4430, -1.0969]  0: empty room\n"
    assert told_but_not_printed(line, line.replace("1.2562", "1.2570")) == []
    for wrong in (line.replace("-1.2562", "1.2562"), line.replace("1.2562", "1.3"), line[:-6]):
        assert told_but_not_printed(line, wrong) == [line.rstrip("\n")]


def test_a_broken_block_is_noticed(tmp_path):
    for language, code in (("bash", "false; true"), ("bash", "false | true"), ("python", "1 / 0")):
        with pytest.raises(AssertionError):
            run_block(language, "", code, tmp_path)
