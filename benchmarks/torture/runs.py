"""The runs of `benchmarks.torture`: how they are started, and what they must leave behind."""

import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

SCENES, SHARD = 400, 50
WORDS = f"render --n {SCENES} --size 32 --min-visible-pixels 3 --shard-size {SHARD} --seed 3"
# Run the command in a process that kills itself just before or after the k-th event of a kind.
HOOKED = """
import builtins, os, signal, sys
kind, at, after = sys.argv[1], int(sys.argv[2]), sys.argv[3] == "after"
del sys.argv[1:4]
def hook(place, name):
    real, seen = getattr(place, name), [0]
    def hooked(*arguments, **named):
        seen[0] += 1
        if seen[0] == at and not after:
            os.kill(os.getpid(), signal.SIGKILL)
        result = real(*arguments, **named)
        if seen[0] == at and after:
            os.kill(os.getpid(), signal.SIGKILL)
        return result
    setattr(place, name, hooked)
if kind == "packing":
    from scenegen.rooms import render
    hook(render, "pack_rooms")
elif kind == "writing":
    from scenegen.files.table import Table
    hook(Table, "extend_packed")
elif kind == "manifest":
    from scenegen.files import making
    hook(making, "write_manifest")
else:
    hook(os, kind)
import cli
cli.scenegen()
"""
EVENTS = {"packing": 25, "writing": 25, "manifest": 10, "replace": 18, "unlink": 18}


class Torture:
    """A folder with an unbroken run to compare others with."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.temporary = folder / "tmp"
        self.temporary.mkdir()
        self.where = folder  # of the last case
        self.environment = {**os.environ, "OMP_NUM_THREADS": "1", "TMPDIR": str(self.temporary)}
        self.unbroken = folder / "unbroken"
        self.unbroken.mkdir()
        start = time.perf_counter()
        self.command(self.unbroken, "1").wait()
        self.seconds = time.perf_counter() - start
        self.expected = contents(self.unbroken)

    def command(
        self,
        where: Path,
        workers: str = "1",
        hook: tuple[str, ...] = (),
        more: tuple[str, ...] = (),
        **options: object,
    ) -> "subprocess.Popen[str]":
        """Start the command in a folder, with more words; `options` are those of Popen."""
        code = HOOKED if hook else "import cli; cli.scenegen()"
        words = [sys.executable, "-c", code, *hook, *WORDS.split(), "--workers", workers, *more]
        streams = {"stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE, "text": True}
        how = {"env": self.environment, **streams, **options}
        return subprocess.Popen(words, cwd=where, **how)  # type: ignore[call-overload]

    def fresh(self, name: str) -> Path:
        """Return an empty folder, in which the next case takes place."""
        self.where = self.folder / name
        shutil.rmtree(self.where, ignore_errors=True)
        self.where.mkdir()
        return self.where

    def left_behind(self) -> str:
        """Return which temporary files the case left, here or where the system has them."""
        folders = [folder for folder in (self.where, self.temporary) if folder.is_dir()]
        names = [path.name for folder in folders for path in folder.iterdir()]
        hidden = [name for name in names if name.startswith(".") or not name.startswith("rooms")]
        return f"left behind: {hidden}" if hidden else ""

    def goes_on(self, where: Path) -> str:
        """Run the same command again; return what is wrong, or nothing.

        A set that was complete when its run was killed must be right, and loses a file.
        """
        manifest = where / "rooms.manifest.json"
        complete = manifest.exists() and '"complete": true' in manifest.read_text()
        if complete and contents(where) != self.expected:
            return "other bytes in a complete set"
        if complete:
            (where / "rooms.h5").unlink()
        again = self.command(where)
        said = again.communicate()[1]
        if again.returncode:
            return f"the second run failed: {said.strip()[-200:]}"
        return "" if contents(where) == self.expected else "other bytes"

    def ended(self, process: "subprocess.Popen[str]", said: str, code: int = 2) -> str:
        """Return what is wrong with how a command ended; with code 2, that is one line and no more.

        Files that it left under their names must be whole.
        """
        lines = [line for line in said.splitlines() if "warning" not in line.lower()]
        clear = "Traceback" not in said and (code != 2 or len(lines) == 1)
        if process.returncode != code or not clear:
            return f"exit {process.returncode}: {said[-200:]!r}"
        whole = all(self.expected.get(n) == data for n, data in contents(self.where).items())
        return "" if whole else "a file that is not whole"


def contents(folder: Path) -> dict[str, bytes]:
    """Return the bytes of each HDF5 file of a folder."""
    return {path.name: path.read_bytes() for path in folder.glob("*.h5")}
