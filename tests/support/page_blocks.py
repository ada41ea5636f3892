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


def page(name):
    return (ROOT / "docs" / name).read_text()


def blocks(text):
    """Return (language, title, code) of each fenced block, in order."""
    return BLOCK.findall(text)


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


def told_but_not_printed(text, printed, within=0.02):
    """Return the lines of a page's text that no later line of what was printed equals.

    Numbers may differ by a share, or as the last digit of what the page says allows.
    """
    lines, missing = iter(printed.splitlines()), []
    for line in filter(str.strip, text.splitlines()):
        if not any(_same(line, other, within) for other in lines):
            missing.append(line)
            lines = iter(printed.splitlines())
    return missing


def _same(told, printed, within):
    if _words(told) != _words(printed):
        return False
    numbers = zip(NUMBER.findall(told), NUMBER.findall(printed), strict=True)
    return all(near(a, b, within) for a, b in numbers)


def _words(line):
    return " ".join(NUMBER.sub("#", line).split())


def near(told, printed, within=0.0):
    """Return whether a number, as it is told, is another one rounded, or near it."""
    told, value = told.replace(",", ""), float(printed.replace(",", ""))
    digits = len(told.partition(".")[2])
    rounding = 0.501 * 10**-digits if digits else 0.0
    return abs(float(told) - value) <= max(rounding, within * abs(value))
