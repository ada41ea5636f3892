"""docs/tutorial.md, from its first block to its last, as a reader runs it; and what it prints."""

from page_blocks import blocks, missing_lines, run_block


def test_the_blocks_print_what_the_page_says(tmp_path):
    """One test, so that one worker runs the page, once."""
    printed, pairs = "", []
    for language, title, code in blocks("tutorial.md"):
        if language == "text":
            pairs.append((code, printed))
        elif output := run_block(language, title, code, tmp_path):
            printed = output
    assert len(pairs) >= 6
    assert [missing_lines(*pair) for pair in pairs] == [[]] * len(pairs)
    for name in ("mine.html", "leaderboard.md"):
        assert "kernel ridge" in (tmp_path / name).read_text()


def test_a_wrong_number_is_noticed():
    line = "  skill of chamfer  -1.2562  [-1.4430, -1.0969]  0: empty room\n"
    assert missing_lines(line, line.replace("1.2562", "1.2570")) == []
    for wrong in (line.replace("-1.2562", "1.2562"), line.replace("1.2562", "1.3"), line[:-6]):
        assert missing_lines(line, wrong) == [line.rstrip("\n")]
