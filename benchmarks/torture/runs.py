"""The runs of `benchmarks.torture`: how they are started, and what they must leave behind."""

import os
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

Process = subprocess.Popen[str]
# The name of a case, and what was wrong: nothing if it survived.
Results = Iterator[tuple[str, str]]

ROOMS = (  # 8 shards
    "scenegen render --n 400 --size 32 --min-visible-pixels 3 --shard-size 50 --seed 3"
    " --out rooms.h5"
)
QUESTIONS = (
    "iqtt make-split --train 120 --labeled 50 --val 30 --test 60 --shard-size 20 --seed 3"
    " --size 32 --min-cube-pixels 1 --cubes 6-8 --out split"
)
# Events of a run of rooms: what is called, and how often about.
EVENTS = {
    "packing": ("scenegen.rooms.render:pack_rooms", 25),
    "writing": ("scenegen.files.table:Table.extend_packed", 25),
    "part": ("scenegen.files.sets.making:move", 18),
    "replace": ("os:replace", 18),
    "unlink": ("os:unlink", 18),
}
# Runs a command in a process that kills itself just before or after the k-th call of a function.
HOOKED = """
import functools, importlib, os, signal, sys
place, at, after = sys.argv[1], int(sys.argv[2]), sys.argv[3] == "after"
del sys.argv[1:4]
module, *owners, name = place.replace(":", ".").rsplit(".", place.count(".", place.index(":")) + 1)
owner = functools.reduce(getattr, owners, importlib.import_module(module))
real, calls = getattr(owner, name), 0
def hooked(*arguments, **named):
    global calls
    calls += 1
    if calls == at and not after:
        os.kill(os.getpid(), signal.SIGKILL)
    result = real(*arguments, **named)
    if calls == at and after:
        os.kill(os.getpid(), signal.SIGKILL)
    return result
setattr(owner, name, hooked)
"""


class Torture:
    """A command, the files of an unbroken run of it, and a folder for cases.

    Attributes:
        where: the folder of the last case.
        seconds: that the unbroken run took.
        expected: the files of the unbroken run.
    """

    def __init__(self, folder: Path, command: str = ROOMS) -> None:
        self.folder, self.words = folder, command.split()
        self.temporary = folder / "tmp"
        self.temporary.mkdir(exist_ok=True)
        self.environment = {**os.environ, "TMPDIR": str(self.temporary)}
        self.fresh("unbroken")
        start = time.perf_counter()
        self.start().communicate()
        self.seconds = time.perf_counter() - start
        self.expected = contents(self.where)

    def fresh(self, name: str) -> Path:
        """Return an empty folder, in which the next case takes place."""
        self.where = self.folder / name
        shutil.rmtree(self.where, ignore_errors=True)
        self.where.mkdir()
        return self.where

    def start(self, *more: str, workers: int = 1, hook: str = "", **options: Any) -> Process:
        """Start the command in the folder of the case.

        Args:
            more: words at its end.
            hook: words for HOOKED; empty for a plain run.
            options: of Popen.
        """
        program, *words = self.words
        code = f"{HOOKED if hook else ''}\nimport cli\ncli.{program}()"
        command = [sys.executable, "-c", code, *hook.split(), *words]
        streams = {"stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE, "text": True}
        how = {"env": self.environment, "cwd": self.where, **streams, **options}
        return subprocess.Popen([*command, "--workers", str(workers), *more], **how)

    def under_way(self, process: Process, shards: int = 1) -> bool:
        """Wait until some shards are there; return whether the process still runs."""
        while (
            len(list(self.where.glob(".rooms.h5.parts/rooms-*"))) < shards
            and process.poll() is None
        ):
            time.sleep(0.02)
        return process.poll() is None

    def goes_on(self) -> str:
        """Run the command again; return what is wrong, or nothing.

        Where the killed run was complete, the command may refuse to replace its files.
        """
        complete = contents(self.where) == self.expected
        again = self.start()
        errors = again.communicate()[1]
        if again.returncode and not (complete and again.returncode == 2):
            return f"the second run failed: {errors.strip()[-200:]}"
        return self.other_bytes()

    def other_bytes(self) -> str:
        """Return what is wrong with the files, or nothing."""
        return "" if contents(self.where) == self.expected else "other bytes"

    def ended(self, process: Process, code: int = 2) -> str:
        """Wait for a command; return what is wrong with its end.

        With code 2 it must say why in one line. Files under their names must be whole.
        """
        errors = (process.communicate()[1] or "").strip()
        lines = [line for line in errors.splitlines() if "warning" not in line.lower()]
        if process.returncode != code or "Traceback" in errors or (code == 2 and len(lines) != 1):
            return f"exit {process.returncode}: {errors[-200:]!r}"
        whole = all(self.expected.get(name) == data for name, data in contents(self.where).items())
        return "" if whole else "a file that is not whole"

    def left_behind(self) -> str:
        """Return which hidden or temporary files there are, here or where the system has them."""
        names = [path.name for path in self.where.rglob(".*")] if self.where.is_dir() else []
        names += [path.name for path in self.temporary.iterdir()]
        return f"left behind: {names}" if names else ""


def contents(folder: Path) -> dict[str, bytes]:
    """Return the bytes of each HDF5 file below a folder."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in folder.rglob("*.h5")
        if not any(part.startswith(".") for part in path.relative_to(folder).parts)
    }
