"""Code blocks of pages, run as a reader runs them, and what pages say they print."""

import os
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
BLOCK = re.compile(r'^```(\w+)(?: title="([\w.]+)")?\n(.*?)^```$', re.MULTILINE | re.DOTALL)
NUMBER = re.compile(r"[-+]?(?<![\w.])\d[\d,]*(?:\.\d+)?(?:e[-+]?\d+)?(?!\w)")
ENVIRONMENT = {
    **os.environ,
    "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}",
    "PYTHONPATH": str(ROOT),
    "OMP_NUM_THREADS": "1",
}


def blocks(page):
    """Return (language, title, code) of each fenced block of a page of docs/, in order."""
    return BLOCK.findall((ROOT / "docs" / page).read_text())


def run_block(language, title, code, folder):
    """Run a block in a folder, as a script that ends at the first error; return what it prints.

    A Python block with a title is only saved, under that name.
    """
    if language == "python" and title:
        (folder / title).write_text(code)
        return ""
    command = {
        "bash": ["bash", "-euo", "pipefail", "-c", code],
        "python": [sys.executable, "-c", code],
    }
    done = subprocess.run(
        command[language], cwd=folder, env=ENVIRONMENT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, f"{code}\n{done.stdout[-2000:]}\n{done.stderr[-4000:]}"
    return done.stdout


def missing_lines(expected, printed, within=0.02):
    """Return the lines of a page that were not printed, in their order.

    Numbers may differ by the share `within`, or by the rounding of the page's last digit.
    """
    lines, missing = iter(printed.splitlines()), []
    for line in filter(str.strip, expected.splitlines()):
        if not any(_same(line, other, within) for other in lines):
            missing.append(line)
            lines = iter(printed.splitlines())
    return missing


def _same(expected, printed, within):
    numbers = [NUMBER.findall(line.replace(",", "")) for line in (expected, printed)]
    words = [NUMBER.sub("#", line.replace(",", "")).split() for line in (expected, printed)]
    return words[0] == words[1] and all(_near(a, b, within) for a, b in zip(*numbers, strict=True))


def _near(expected, printed, within):
    digits = len(expected.partition(".")[2])
    rounding = 0.501 * 10**-digits if digits else 0.0
    value = float(printed)
    return abs(float(expected) - value) <= max(rounding, within * abs(value))
