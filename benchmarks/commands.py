"""Commands of this project, run one by one in a folder that knows which of them are done."""

import os
import shlex
import signal
import subprocess
import sys
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import IO

ROOT = Path(__file__).parents[1]
PROGRAMS = ("scenegen", "iqtt", "bench", "pix2shape")


def product(command: str) -> str:
    """Return the file or folder that a command makes; "" where it prints alone."""
    words = shlex.split(command)
    made = (words[i + 1] for i, word in enumerate(words) if word in ("--out", "--json"))
    return next(made, "")


def is_done(folder: Path, command: str) -> bool:
    """Return whether a command ran to its end in a folder."""
    note = folder / "done.txt"
    return note.exists() and command in note.read_text().splitlines()


def run(
    folder: Path, command: str, *, seconds: float | None = None, log: Path | None = None
) -> bool:
    """Run a command in a folder, with this checkout's code; return whether it ended well.

    A training that has a checkpoint goes on from it. A command that runs longer than `seconds` is
    killed with what it started. What it prints goes to `log`, and its errors to a file beside it;
    without, both are shown.
    """
    words, out = shlex.split(command), folder / product(command)
    out.parent.mkdir(parents=True, exist_ok=True)
    if product(command) and any(out.glob("checkpoint*")):  # the run keeps its settings
        kept = ("--data", "--out", "--minutes", "--device")
        first = next(i for i, word in enumerate(words) if word.startswith("--"))
        words = [*words[:first], *_options(words[first:], kept), "--resume"]
    print(f"$ {shlex.join(words)}", flush=True)
    program, *arguments = words
    starts = f"import sys, cli; sys.argv[0] = {program!r}; cli.{program}()"
    start = ["-c", starts] if program in PROGRAMS else ["-m", program]
    path = os.pathsep.join([str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])])
    told: IO[bytes] | int | None = None
    errors: IO[bytes] | None = None
    if arguments[:1] == ["score"]:
        told = subprocess.DEVNULL  # pages of tables
    with ExitStack() as files:
        if log is not None:
            told = files.enter_context(log.open("wb"))
            errors = files.enter_context(log.with_suffix(".err").open("wb"))
        child = subprocess.Popen(
            [sys.executable, *start, *arguments],
            cwd=folder, env={**os.environ, "PYTHONPATH": path}, start_new_session=True,
            stdout=told, stderr=errors,
        )  # fmt: skip
        try:
            ended_well = child.wait(seconds) == 0
        except subprocess.TimeoutExpired:
            print(f"stopped after {seconds:.0f} s: {command}", flush=True)
            ended_well = False
        finally:
            with suppress(ProcessLookupError):
                os.killpg(child.pid, signal.SIGKILL)
            child.wait()
    if ended_well:
        with (folder / "done.txt").open("a") as done:
            done.write(f"{command}\n")
    return ended_well


def _options(words: list[str], kept: tuple[str, ...]) -> list[str]:
    """Return the options of these names with their values."""
    chosen = list[str]()
    keep = False
    for word in words:
        keep = word in kept if word.startswith("--") else keep
        chosen += [word] if keep else []
    return chosen
