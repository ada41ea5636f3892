"""The short form of `make fuzz`: known cases, and some new ones of each target."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from fuzz.programs import TARGETS

ROOT = Path(__file__).parents[2]
CASES = 2  # of each target
TRIED = [target for target in TARGETS if not target.imports_torch]  # torch takes its time


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> subprocess.CompletedProcess[str]:
    corpus = tmp_path_factory.mktemp("corpus")
    only = [word for target in TRIED for word in ("--only", target.name)]
    options = ["--cases", CASES, "--jobs", 2, "--corpus", corpus, *only]
    command = [sys.executable, "-m", "fuzz", *map(str, options)]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)


def test_no_case_is_a_fault(done):
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize("target", TRIED, ids=lambda target: target.name)
def test_all_targets_had_their_cases(done, target):
    found = re.search(rf"^{target.name} +([0-9]+) cases$", done.stdout, re.MULTILINE)
    assert int(found[1]) >= CASES


def test_most_cases_were_what_they_say(done):
    unmade = int(re.search("([0-9]+) edits did not fit", done.stdout)[1])
    assert unmade < 0.1 * CASES * len(TRIED)
