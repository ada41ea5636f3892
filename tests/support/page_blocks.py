"""Code blocks of pages, run as a reader runs them, and what pages say they print."""

import contextlib
import gc
import io
import os
import re
import runpy
import subprocess
import sys
import traceback
import warnings
from pathlib import Path
from unittest import mock

from click.testing import CliRunner

ROOT = Path(__file__).parents[2]
BLOCK = re.compile(r'^```(\w+)(?: title="([\w.]+)")?\n(.*?)^```$', re.MULTILINE | re.DOTALL)
NUMBER = re.compile(r"[-+]?(?<![\w.])\d[\d,]*(?:\.\d+)?(?:e[-+]?\d+)?(?!\w)")
PROGRAMS = ("scenegen", "iqtt", "bench", "pix2shape", "python")
# Starting Python takes longer than most commands: bash asks this process to run the programs.
ASKING = """set -euo pipefail
ask() {{ printf '%s\\0' "$#" "$@" >&{asked}; read -r code <&{told}; cat {out}; return "$code"; }}
""" + "".join(f'{name}() {{{{ ask {name} "$@"; }}}}\n' for name in PROGRAMS)


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
    with contextlib.chdir(folder), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # as for a reader
        if language == "bash":
            return _run_bash(code, folder.with_name(f"{folder.name}-printed"))
        main = {"__name__": "__main__"}
        status, printed = _run_python(lambda: exec(compile(code, "block", "exec"), main))
        if "inspect_ai" in code:
            main.clear()
            gc.collect()  # while warnings about what is left open are ignored
    assert status == 0, f"{code}\n{printed[-4000:]}"
    return printed


def _run_bash(code, out):
    """Run a script; run the programs that it asks for, and leave in `out` what each prints."""
    (asked, asks), (hears, told) = os.pipe(), os.pipe()
    script = ASKING.format(asked=asks, told=hears, out=out) + code
    with subprocess.Popen(
        ["bash", "-c", script],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        pass_fds=(asks, hears),
        text=True,
        env={**os.environ, "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}"},
    ) as bash:
        os.close(asks)
        os.close(hears)
        with open(asked) as requests, open(told, "w") as replies:
            while count := _word(requests):
                status, printed = _run_program(*(_word(requests) for _ in range(int(count))))
                out.write_text(printed)
                print(status, file=replies, flush=True)
        printed = bash.communicate()[0]
    assert bash.returncode == 0, f"{code}\n{printed[-4000:]}"
    return printed


def _word(file):
    """Read up to the next NUL, or to the end."""
    return "".join(iter(lambda: file.read(1).strip("\0"), ""))


def _run_program(program, *words):
    """Run a program of PROGRAMS in this process; return its exit code and what it prints."""
    if program == "python":
        return _run_python(lambda: runpy.run_path(words[0], run_name="__main__"))
    import cli

    with mock.patch("metrics.scoring.images.rows.processors", return_value=1):
        # pytest-xdist sets COLUMNS of its workers to the width of its own terminal.
        result = CliRunner().invoke(getattr(cli, program), words, env={"COLUMNS": "100"})
    if result.exception and not isinstance(result.exception, SystemExit):
        return 1, "".join(traceback.format_exception(result.exception))
    return result.exit_code, result.stdout if result.exit_code == 0 else result.output


def _run_python(program):
    with contextlib.redirect_stdout(io.StringIO()) as out:
        try:
            program()
        except Exception:
            return 1, out.getvalue() + traceback.format_exc()
    return 0, out.getvalue()


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
