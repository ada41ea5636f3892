"""What a command may do with hostile input, and what of that it did not keep to."""

import re
import stat
import unicodedata
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from fuzz.cases import Case
from fuzz.child import Run
from fuzz.programs import OUTPUTS, Target

LONGEST_ERROR = 10_000  # characters of all that a refusal prints
MOST_MEGABYTES = 2048  # beyond the honest run's
SIGPIPE = -13
DIRECTIONS = re.compile("[\u061c\u200e\u200f\u202a-\u202e\u2066-\u2069]")
Files = Mapping[str, tuple[int, ...]]


@dataclass(frozen=True)
class Fault:
    """What is wrong with a run: its kind, and what was seen."""

    kind: str
    seen: str

    def __str__(self) -> str:
        return f"{self.kind}: {self.seen}"


def files_in(folder: Path) -> Files:
    """Return name, kind, inode, size and time of change of all below a folder."""
    found = {}
    for path in sorted(folder.rglob("*")):
        name, status = str(path.relative_to(folder)), path.lstat()
        size, changed = (
            (status.st_size, status.st_mtime_ns) if stat.S_ISREG(status.st_mode) else (0, 0)
        )
        if not name.startswith(".home"):
            found[name] = (stat.S_IFMT(status.st_mode), status.st_ino, size, changed)
    return found


def faults(
    case: Case, target: Target, run: Run, honest_megabytes: float, before: Files, after: Files
) -> list[Fault]:
    """Return everything that is wrong with a run."""
    return [
        *_ended(case, target, run),
        *_printed(case, run),
        *_used(run, honest_megabytes),
        *_left(case, run, before, after),
    ]


def _ended(case: Case, target: Target, run: Run) -> Iterator[Fault]:
    if b"Traceback" in run.err + run.out:
        yield Fault("traceback", _last_line(run.err))
        return
    allowed = {0, 2, *target.codes}
    if case.stdout == "closed pipe":
        allowed |= {1, SIGPIPE}  # click ends with 1 where nobody reads
    if run.code not in allowed and not run.timed_out:
        kind = "signal" if run.code < 0 else "exit code"
        yield Fault(kind, f"{run.code} {_last_line(run.err)}")
    told = b"wrong " in run.out or case.stdout != "file"
    listed = case.arguments[1:2] == ("validate",) and told
    if run.code == 2 and not listed:
        yield from _refused(run.err.decode(errors="replace"))


def _refused(text: str) -> Iterator[Fault]:
    """A refusal is one line, after the usage where click complains, and after notes."""
    lines = [line for line in text.split("\n") if line.strip() and not line.startswith("note: ")]
    if lines and lines[0].startswith("Usage: "):
        begins = [i for i, line in enumerate(lines) if line.startswith("Error: ")]
        lines = lines[begins[0] :] if begins else lines
    if len(lines) != 1 or not lines[0].startswith("Error: "):
        yield Fault("not one line of error", repr(text[-300:]))
    if len(text) > LONGEST_ERROR:
        yield Fault("long error", f"{len(text)} characters, {text[:100]!r}")


def _printed(case: Case, run: Run) -> Iterator[Fault]:
    for name, data in (("stdout", run.out), ("stderr", run.err)):
        if name == "stdout" and case.stdout != "file":
            continue
        text = data.decode(errors="surrogateescape")
        bad = next(
            (c for c in text if c not in "\n\t" and unicodedata.category(c) in ("Cc", "Cs")), None
        )
        bad = bad or (found[0] if (found := DIRECTIONS.search(text)) else None)
        if bad is not None and "Traceback" not in text:
            at = text.index(bad)
            yield Fault("control character", f"{name}: {text[max(0, at - 60) : at + 40]!r}")


def _used(run: Run, honest_megabytes: float) -> Iterator[Fault]:
    if run.timed_out:
        yield Fault("time", f"over {run.seconds:.0f} s")
    if run.megabytes > honest_megabytes + MOST_MEGABYTES:
        yield Fault("memory", f"{run.megabytes:.0f} MB")
    if re.search(rb"^Error: .*(MemoryError|[Uu]nable to allocate)", run.err, re.MULTILINE):
        yield Fault("memory", f"asked for too much: {_last_line(run.err)}")
    if run.left:
        yield Fault("process", "one of its processes outlived it")


def _left(case: Case, run: Run, before: Files, after: Files) -> Iterator[Fault]:
    """Inputs stay as they were; nothing appears but what was asked for, and nothing on refusal."""
    if run.timed_out:
        return
    words = [word.removeprefix("./") for word in case.arguments[2:]]
    named = {word.rstrip("/") for word in words} | {"predictions.h5", "questions.png", "sheet.png"}
    written = {word for i, word in enumerate(words) if case.arguments[i + 1] in OUTPUTS}
    read = {word for i, word in enumerate(words) if case.arguments[i + 1] not in OUTPUTS}
    for name, state in before.items():
        gone = after.get(name, (0, 0, 0, 0))
        may = "--overwrite" in words and name in written - read
        if (
            gone != state
            and not may
            and not stat.S_ISDIR(state[0])
            and not name.startswith("cache/")
        ):
            yield Fault("input changed", f"{name} (exit code {run.code})")
    for name in sorted(set(after) - set(before)):
        if name.startswith("cache/"):
            continue
        inside = [str(parent) for parent in Path(name).parents]
        asked = name in named or any(parent in named for parent in inside)
        hidden = any(part.startswith(".") and part not in named for part in Path(name).parts)
        if not asked or hidden or ".partial" in name:
            yield Fault("leftover", f"{name} (exit code {run.code})")
        elif run.code == 2 and case.stdout == "file" and stat.S_ISREG(after[name][0]):
            yield Fault("written though refused", f"{name}: {_last_line(run.err)}")


def _last_line(err: bytes) -> str:
    lines = [line for line in err.decode(errors="replace").splitlines() if line.strip()]
    return lines[-1][:300] if lines else "nothing printed"
