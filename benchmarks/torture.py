"""Runs that are killed, stopped, or meet a broken disk, and then go on: one Markdown table.

`python -m benchmarks.torture [--kills 50] [--parts kills,signals,disk]`, from the repository's
root. Every run must end with the bytes of an unbroken run, and leave nothing else behind.
"""

import argparse
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
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
    from scenegen.common.hdf5.table import Table
    hook(Table, "extend_packed")
elif kind == "manifest":
    from scenegen.rooms import shards
    hook(shards, "write_manifest")
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
        self.environment = {**os.environ, "OMP_NUM_THREADS": "1"}
        self.unbroken = folder / "unbroken"
        self.unbroken.mkdir()
        start = time.perf_counter()
        self.command(self.unbroken, "1").wait()
        self.seconds = time.perf_counter() - start
        self.expected = contents(self.unbroken)

    def command(
        self, where: Path, workers: str = "1", hook: tuple[str, ...] = (), **options: object
    ) -> "subprocess.Popen[str]":
        """Start the command in a folder."""
        code = HOOKED if hook else "import cli; cli.scenegen()"
        words = [sys.executable, "-c", code, *hook, *WORDS.split(), "--workers", workers]
        return subprocess.Popen(
            words, cwd=where, env=self.environment, stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE, text=True, **options,  # type: ignore[call-overload]
        )  # fmt: skip

    def fresh(self, name: str) -> Path:
        """Return an empty folder."""
        place = self.folder / name
        shutil.rmtree(place, ignore_errors=True)
        place.mkdir()
        return place

    def goes_on(self, where: Path) -> str:
        """Run the same command again, if it was not done; return what is wrong, or nothing."""
        manifest = where / "rooms.manifest.json"
        if manifest.exists() and '"complete": true' in manifest.read_text():
            return "" if contents(where) == self.expected else "other bytes"
        again = self.command(where)
        said = again.communicate()[1]
        if again.returncode:
            return f"the second run failed: {said.strip()[-200:]}"
        if contents(where) != self.expected:
            return "other bytes"
        hidden = [p.name for p in where.iterdir() if p.name.startswith(".")]
        return f"left behind: {hidden}" if hidden else ""


def contents(folder: Path) -> dict[str, bytes]:
    """Return the bytes of each HDF5 file of a folder."""
    return {path.name: path.read_bytes() for path in folder.glob("*.h5")}


def kills(torture: Torture, count: int) -> Iterator[tuple[str, str]]:
    """Kill runs, half of them at a random time, half of them at an event; go on with each."""
    dice = random.Random(0)
    for number in range(count):
        where = torture.fresh("killed")
        if number % 2:
            kind = dice.choice(list(EVENTS))
            at = 1 + dice.randrange(EVENTS[kind])
            process = torture.command(where, "1", (kind, str(at), dice.choice(["before", "after"])))
            process.communicate()
            name = f"SIGKILL at a {kind}"
        else:
            process = torture.command(where, dice.choice(["1", "2"]))
            time.sleep(dice.uniform(0.2, torture.seconds))
            process.kill()
            process.communicate()
            name = "SIGKILL at a random time"
        yield name, torture.goes_on(where)


def signals(torture: Torture, count: int) -> Iterator[tuple[str, str]]:
    """End runs by the signals that ask for it."""
    dice = random.Random(1)
    for number in range(count):
        one = (signal.SIGTERM, signal.SIGHUP, signal.SIGINT)[number % 3]
        where = torture.fresh("stopped")
        process = torture.command(where, "2")
        while not list(where.glob("rooms-*")) and process.poll() is None:
            time.sleep(0.02)
        time.sleep(dice.uniform(0, torture.seconds / 4))
        start = time.perf_counter()
        process.send_signal(one)
        said = process.communicate()[1]
        seconds = time.perf_counter() - start
        problem = "" if seconds < 2 else f"it took {seconds:.1f} s"
        if not (where / "rooms.h5").exists():  # else it was done before
            problem = problem or ("" if "goes on" in said else f"it said {said.strip()[-80:]!r}")
            left = [p.name for p in where.iterdir() if p.name.endswith(".partial")]
            problem = problem or (f"left behind: {left}" if left else torture.goes_on(where))
        yield f"{one.name}, ended within 2 s", problem


def disk(torture: Torture, _count: int) -> Iterator[tuple[str, str]]:
    """Let the disk refuse in several ways."""

    def refused(name: str, where: Path, **options: object) -> tuple[str, str]:
        process = torture.command(where, **options)  # type: ignore[arg-type]
        said = process.communicate()[1].strip()
        lines = [line for line in said.splitlines() if "warning" not in line.lower()]
        clear = process.returncode == 2 and len(lines) == 1 and "Traceback" not in said
        whole = all(torture.expected.get(n) == data for n, data in contents(where).items())
        problem = "" if clear else f"exit {process.returncode}: {said[-200:]!r}"
        return name, problem or ("" if whole else "a file that is not whole")

    def limit() -> None:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, 200_000))

    where = torture.fresh("quota")
    yield refused("a limit on the size of files", where, preexec_fn=limit)
    yield "the same, then without it", torture.goes_on(where)
    where = torture.fresh("small")
    if subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=2m", "none", where], check=False
    ).returncode:
        yield "a full disk (a tmpfs of 2 MB)", "not tried: cannot mount"
    else:
        try:
            yield refused("a full disk (a tmpfs of 2 MB)", where)
            subprocess.run(["mount", "-o", "remount,size=64m", where], check=True)
            yield "the same, then with room", torture.goes_on(where)
        finally:
            subprocess.run(["umount", where], check=True)
    where = torture.fresh("shared")
    first = torture.command(where)
    while not list(where.glob("*.json")) and first.poll() is None:
        time.sleep(0.02)
    yield refused("a second run of the same set", where)
    first.communicate()
    yield "the first of the two", "" if contents(where) == torture.expected else "other bytes"
    where = torture.fresh("vanishing")
    process = torture.command(where)
    while not list(where.glob("rooms-*")) and process.poll() is None:
        time.sleep(0.02)
    shutil.rmtree(where, ignore_errors=True)
    said = process.communicate()[1]
    clear = process.returncode == 2 and "Traceback" not in said
    yield "a folder that vanishes", "" if clear else f"exit {process.returncode}: {said[-200:]!r}"


PARTS: dict[str, Callable[[Torture, int], Iterator[tuple[str, str]]]]
PARTS = {"kills": kills, "signals": signals, "disk": disk}


def main() -> None:
    """Print a row for each kind of trouble; exit with 1 if a run did not survive it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument("--parts", default=",".join(PARTS))
    arguments = parser.parse_args()
    tried, survived, problems = Counter[str](), Counter[str](), []
    with tempfile.TemporaryDirectory(prefix="torture-") as name:
        torture = Torture(Path(name))
        for part in arguments.parts.split(","):
            for what, problem in PARTS[part](torture, arguments.kills if part == "kills" else 9):
                tried[what] += 1
                survived[what] += not problem
                print(f"{what}: {problem or 'survived'}", file=sys.stderr, flush=True)
                problems += [f"{what}: {problem}"] if problem else []
    print("| trouble | runs | survived |\n| --- | ---: | ---: |")
    for what in sorted(tried):
        print(f"| {what} | {tried[what]} | {survived[what]} |")
    print(f"\n{sum(survived.values())} of {sum(tried.values())} runs survived")
    print("\n".join(problems))
    sys.exit(1 if problems else 0)


if __name__ == "__main__":
    main()
