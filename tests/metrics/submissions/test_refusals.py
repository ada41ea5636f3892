"""Every broken submission of the corpus: told by `validate`, the reader and `bench score` alike."""

import tracemalloc

import pytest
from broken import CASES
from click.testing import CliRunner

import cli
from metrics.submissions.layout import ATTRIBUTES, COLUMNS
from metrics.submissions.reader import open_predictions
from metrics.submissions.validation import validate
from scenegen.common.errors import SceneGenError

BYTES = 64 * 2**20
NAMES = {thing.name for thing in (*ATTRIBUTES, *COLUMNS["rooms"], *COLUMNS["iqtt"])}


def lines_of(problems):
    """All problems as lines, each checked to be one."""
    lines = [str(problem) for problem in problems]
    assert [line for line in lines if "\n" in line or len(line) > 400 or not line] == []
    assert all(line.isprintable() for line in lines), lines
    return lines


def problems_of(case, path, truth):
    """What `validate` says, in little memory; None where it says that no file is there."""
    tracemalloc.start()
    try:
        problems = validate(path, truth)
    except OSError:
        problems = None
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < BYTES, f"{peak / 2**20:.0f} MiB"
    return problems


@pytest.mark.parametrize("case", CASES, ids=str)
def test_a_broken_submission(case, truths, tmp_path, monkeypatch, check_refusal):
    monkeypatch.chdir(tmp_path)
    path = case.build(tmp_path, truths.of(case.task))
    truth = None if case.names_truth else truths.of(case.task)
    problems = problems_of(case, path, truth)
    if problems is not None:
        lines = lines_of(problems)
        # "row 3, cannot be read" is the line of scoring; validate counts the rows.
        words = [word.removeprefix("row ") for word in case.words]
        fits = [p for p in problems if all(word in str(p) for word in words)]
        assert fits, lines
        assert all(problem.is_hint for problem in problems) == (case.stage == "hint")
        if words[0] in NAMES and case.names_truth:
            assert words[0] in {problem.dataset for problem in fits}
    if case.stage == "open":
        with pytest.raises((SceneGenError, OSError)) as caught:
            open_predictions(path)
        if case.words[0] in NAMES and case.names_truth:
            assert caught.value.where == f"{path}: {case.words[0]}"
        if case.task == "rooms":  # what opening refuses, scoring does: it opens, too
            return
    else:
        open_predictions(path).close()
    options = [] if truth is None else ["--truth", str(truth)]
    result = CliRunner().invoke(cli.bench, ["score", str(path), *options, "--json", "x.json"])
    if case.stage == "hint":
        assert result.exit_code == 0, result.output
        told = CliRunner().invoke(cli.bench, ["validate", str(path), *options]).stdout
        assert all(word in text for word in case.words for text in (result.stderr, told))
    else:
        check_refusal(result.exit_code, result.stdout, result.stderr, case.words)
    assert (tmp_path / "x.json").exists() == (case.stage == "hint")
