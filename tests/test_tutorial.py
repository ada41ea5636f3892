"""docs/tutorial.md, from its first block to its last, as a reader runs it; and what it prints."""

import pytest
from page_blocks import blocks, missing_lines, run_block

SMALLER = (("--n 200", "--n 20"), ("--test 200", "--test 20"))  # --n 2000 becomes --n 200


def printed_by_page(folder, smaller=()):
    """Run the page with smaller numbers; return (text of the page, what was printed) pairs."""
    printed, pairs = "", []
    for language, title, written in blocks("tutorial.md"):
        if language == "text":
            pairs.append((written, printed))
            continue
        code = written
        for words, fewer in smaller:
            code = code.replace(words, fewer)
        printed = run_block(language, title, code, folder) or printed
    assert len(pairs) >= 6
    for name in ("mine.html", "leaderboard.md"):
        assert "kernel ridge" in (folder / name).read_text()
    return pairs


def test_the_blocks_run_on_a_tenth_of_the_rows(tmp_path):
    """One test, so that one worker runs the page, once."""
    for text, printed in printed_by_page(tmp_path, SMALLER):
        begins = [line.split()[0] for line in printed.splitlines() if line.strip()]
        names = [line.split()[0] for line in text.splitlines()]
        assert [name for name in names if name.isidentifier() and name not in begins] == []


@pytest.mark.slow
def test_the_blocks_print_what_the_page_says(tmp_path):
    pairs = printed_by_page(tmp_path)
    assert [missing_lines(*pair) for pair in pairs] == [[]] * len(pairs)


def test_a_wrong_number_is_noticed():
    line = "  chamfer  -1.2562  [-1.4430, -1.0969]  0: empty room\n"
    assert missing_lines(line, line.replace("1.2562", "1.2570")) == []
    for wrong in (line.replace("-1.2562", "1.2562"), line.replace("1.2562", "1.3"), line[:-6]):
        assert missing_lines(line, wrong) == [line.rstrip("\n")]
