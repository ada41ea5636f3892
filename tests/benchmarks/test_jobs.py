"""Commands of the size of users' jobs end well, within limits of memory."""

import shlex

import pytest

from benchmarks.torture import jobs


@pytest.mark.slow
@pytest.mark.parametrize("name", jobs.JOBS)
def test_a_job_of_a_user_s_size_ends_within_its_memory(name, tmp_path):
    assert jobs.run_job(name, tmp_path) == ""


@pytest.mark.parametrize(
    ("code", "problem"), [("pass", ""), ("import sys; sys.exit(3)", "exit"), ("b'1' * 10**8", "MB")]
)
def test_exit_codes_and_peaks_of_memory_count(code, problem, tmp_path, monkeypatch):
    monkeypatch.setitem(jobs.JOBS, "own", jobs.Job([f"python {shlex.quote(code)}"], 90))
    wrong = jobs.run_job("own", tmp_path)
    assert problem in wrong
    assert bool(problem) == bool(wrong)
