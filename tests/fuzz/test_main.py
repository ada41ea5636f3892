"""The short form of `make fuzz`: known cases, and some new ones of each target."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from fuzz.programs import TARGETS

ROOT = Path(__file__).parents[2]
CASES = 5  # of each target
TRIED = [target for target in TARGETS if not target.imports_torch]  # torch takes its time


@pytest.fixture(scope="module")
def summary(tmp_path_factory: pytest.TempPathFactory) -> str:
    corpus = tmp_path_factory.mktemp("corpus")
    only = [word for target in TRIED for word in ("--only", target.name)]
    options = ["--cases", CASES, "--jobs", 1, "--corpus", corpus, *only]
    command = [sys.executable, "-m", "fuzz", *map(str, options)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode in (0, 1), done.stderr
    return done.stdout


def test_no_case_is_a_fault(summary):
    assert "\n0 distinct faults" in summary, summary


@pytest.mark.parametrize("target", TRIED, ids=lambda target: target.name)
def test_all_targets_had_their_cases(summary, target):
    assert int(re.search(rf"^{target.name} +([0-9]+) cases$", summary, re.MULTILINE)[1]) >= CASES


def test_most_cases_were_what_they_say(summary):
    unmade = int(re.search("([0-9]+) edits did not fit", summary)[1])
    assert unmade < 0.1 * CASES * len(TRIED)
