"""Runs that are killed, stopped, or meet trouble of many kinds, and then go on: one Markdown table.

`python -m benchmarks.torture [--kills 50] [--parts kills,signals,...]`, from the repository's root.
Every run must end with the bytes of an unbroken run, and leave no temporary file. All is written
below one temporary folder, some 1.5 GB.
"""

import argparse
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

from benchmarks.torture.cluster import cluster
from benchmarks.torture.growth import growth
from benchmarks.torture.questions import questions
from benchmarks.torture.runs import EVENTS, Torture, contents
from benchmarks.torture.surroundings import clock, pipes, read_only


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
            problem = problem or torture.left_behind() or torture.goes_on(where)
        yield f"{one.name}, ended within 2 s", problem


def disk(torture: Torture, _count: int) -> Iterator[tuple[str, str]]:
    """Let the disk refuse in several ways."""

    def refused(name: str, where: Path, **options: object) -> tuple[str, str]:
        process = torture.command(where, **options)  # type: ignore[arg-type]
        return name, torture.ended(process, process.communicate()[1].strip())

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
    second = refused("a second run of the same set", where)
    first.communicate()
    yield second
    yield "the first of the two", "" if contents(where) == torture.expected else "other bytes"
    where = torture.fresh("vanishing")
    process = torture.command(where)
    while not list(where.glob("rooms-*")) and process.poll() is None:
        time.sleep(0.02)
    shutil.rmtree(where, ignore_errors=True)
    said = process.communicate()[1].strip()
    yield "a folder that vanishes", torture.ended(process, said)


PARTS: dict[str, Callable[[Torture, int], Iterator[tuple[str, str]]]]
PARTS = {
    "kills": kills, "signals": signals, "disk": disk, "read_only": read_only, "pipes": pipes,
    "clock": clock, "cluster": cluster, "questions": questions, "growth": growth,
}  # fmt: skip


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
            count = arguments.kills if part == "kills" else 9
            for what, wrong in PARTS[part](torture, count):
                problem = wrong or torture.left_behind()
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
