"""The table of mutants fits the code, so that it can be run at any time."""

from benchmarks.mutants import ROOT, rows


def test_every_mutant_has_one_place_and_tests():
    """Where a line was changed, change its row, or drop it with the line."""
    for row in rows():
        assert (ROOT / row["file"]).read_text().count(row["old"]) == 1, row
        assert all((ROOT / test.partition("::")[0]).is_file() for test in row["tests"]), row
