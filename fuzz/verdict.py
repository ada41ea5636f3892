"""What a command may do with hostile input, and what of that it did not keep to."""

import re
import stat
import unicodedata
from collections.abc import Iterator, Mapping
from pathlib import Path

from fuzz.cases import Case
from fuzz.child import Run
from fuzz.programs import CAN_FIND_FAULTS, OUTPUTS

LONGEST_ERROR = 10_000  # characters of all that a refusal prints
MOST_MEGABYTES = 2048  # beyond the honest run's
SIGPIPE = -13
DIRECTIONS = "\u061c\u200e\u200f\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069"
Faults = Iterator[tuple[str, str]]  # the kind of a fault, and what was seen
Files = Mapping[str, tuple[int, ...]]


def files_in(folder: Path) -> Files:
    """Return name, kind, inode, size and time of change of all below a folder."""
    files = {}
    for path in sorted(folder.rglob("*")):
        name, status = str(path.relative_to(folder)), path.lstat()
        regular = stat.S_ISREG(status.st_mode)
        content = (status.st_size, status.st_mtime_ns) if regular else (0, 0)
        if not name.startswith((".home", "cache/")):
            files[name] = (stat.S_IFMT(status.st_mode), status.st_ino, *content)
    return files


def faults(case: Case, run: Run, honest_megabytes: float, before: Files, after: Files) -> Faults:
    """Yield everything that is wrong with a run."""
    yield from _ended(case, run)
    yield from _printed(case, run)
    if run.timed_out:
        yield "time", f"over {run.seconds:.0f} s"
    else:
        yield from _left(case, run, before, after)
    if run.megabytes > honest_megabytes + MOST_MEGABYTES:
        yield "memory", f"{run.megabytes:.0f} MB"
    if re.search(rb"^Error: .*(MemoryError|[Uu]nable to allocate)", run.err, re.MULTILINE):
        yield "memory", f"asked for too much: {_last_line(run.err)}"
    if run.left:
        yield "process", "one of its processes outlived it"


def _ended(case: Case, run: Run) -> Faults:
    if b"Traceback" in run.err + run.out:
        yield "traceback", _last_line(run.err)
        return
    allowed = {0, 2, *([1] if case.target in CAN_FIND_FAULTS else [])}
    if case.stdout == "closed pipe":
        allowed |= {1, SIGPIPE}  # click ends with 1 where nobody reads
    if run.code not in allowed and not run.timed_out:
        yield ("signal" if run.code < 0 else "exit code"), f"{run.code} {_last_line(run.err)}"
    has_list = case.arguments[1:2] == ("validate",)
    listed = has_list and (b"wrong " in run.out or case.stdout != "file")
    if run.code == 2 and not listed:
        yield from _refused(run.err.decode(errors="replace"))


def _refused(text: str) -> Faults:
    """A refusal is one line, after the usage where click complains, and after notes."""
    lines = [line for line in text.split("\n") if line.strip() and not line.startswith("note: ")]
    if lines and lines[0].startswith("Usage: "):
        begins = [i for i, line in enumerate(lines) if line.startswith("Error: ")]
        lines = lines[begins[0] :] if begins else lines
    if len(lines) != 1 or not lines[0].startswith("Error: "):
        yield "not one line of error", repr(text[-300:])
    if len(text) > LONGEST_ERROR:
        yield "long error", f"{len(text)} characters, {text[:100]!r}"


def _printed(case: Case, run: Run) -> Faults:
    """Only printable characters may reach a terminal."""
    streams = {"stderr": run.err, **({"stdout": run.out} if case.stdout == "file" else {})}
    for name, data in streams.items():
        text = data.decode(errors="surrogateescape")
        for place, letter in enumerate(text):
            control = letter not in "\n\t" and unicodedata.category(letter) in ("Cc", "Cs")
            if (control or letter in DIRECTIONS) and "Traceback" not in text:
                part = text[max(0, place - 60) : place + 40]
                yield "control character", f"{name}: {part!r}"
                break


def _left(case: Case, run: Run, before: Files, after: Files) -> Faults:
    """Inputs stay as they were; nothing appears but what was asked for, and nothing on refusal."""
    words = [word.removeprefix("./") for word in case.arguments[2:]]
    named = {word.rstrip("/") for word in words} | {"predictions.h5", "questions.png", "sheet.png"}
    written = {word for i, word in enumerate(words) if case.arguments[i + 1] in OUTPUTS}
    read = {word for i, word in enumerate(words) if case.arguments[i + 1] not in OUTPUTS}
    for name, state in before.items():
        may_change = "--overwrite" in words and name in written - read
        if after.get(name) != state and not may_change and not stat.S_ISDIR(state[0]):
            yield "input changed", f"{name} (exit code {run.code})"
    for name in sorted(set(after) - set(before)):
        parents = [str(parent) for parent in Path(name).parents]
        asked_for = name in named or any(parent in named for parent in parents)
        hidden = any(part.startswith(".") and part not in named for part in Path(name).parts)
        if not asked_for or hidden or ".partial" in name:
            yield "leftover", f"{name} (exit code {run.code})"
        elif run.code == 2 and case.stdout == "file" and stat.S_ISREG(after[name][0]):
            yield "written though refused", f"{name}: {_last_line(run.err)}"


def _last_line(err: bytes) -> str:
    lines = [line for line in err.decode(errors="replace").splitlines() if line.strip()]
    return lines[-1][:300] if lines else "nothing printed"
