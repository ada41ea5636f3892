"""The short form of `make fuzz`: known cases, and a new one of each target but those of torch."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from fuzz.programs import TARGETS, WITH_TORCH

ROOT = Path(__file__).parents[2]
SUBMISSIONS = ["score answers", "validate"]


@pytest.mark.parametrize(
    "targets",
    [
        pytest.param(SUBMISSIONS, id="submissions"),
        pytest.param(sorted({*TARGETS} - {*WITH_TORCH, *SUBMISSIONS}), marks=pytest.mark.slow),
    ],
)
def test_no_case_is_a_fault(targets, tmp_path):
    only = [word for name in targets for word in ("--only", name)]
    options = ["--cases", "1", "--jobs", "2", "--corpus", str(tmp_path), *only]
    command = [sys.executable, "-m", "fuzz", *options]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    counts = dict(re.findall(r"^(\w[\w ]*?) +([0-9]+) cases", done.stdout, re.MULTILINE))
    assert {*targets, "all"} == set(counts)
    assert int(re.search("([0-9]+) edits did not fit", done.stdout)[1]) < 0.1 * int(counts["all"])
