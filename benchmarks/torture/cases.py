"""Kills, signals, refusing disks and folders, lost streams, and dying workers of a cluster."""

import os
import random
import resource
import shutil
import signal
import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from benchmarks.torture.runs import EVENTS, QUESTIONS, Results, Torture


def kills(torture: Torture, count: int) -> Results:
    """Kill runs, half of them at a random time, half of them at an event; go on with each."""
    dice = random.Random(0)
    for number in range(count):
        torture.fresh("killed")
        if number % 2:
            kind = dice.choice(list(EVENTS))
            place, often = EVENTS[kind]
            when = f"{1 + dice.randrange(often)} {dice.choice(['before', 'after'])}"
            process = torture.start(hook=f"{place} {when}")
            errors = process.communicate()[1]
            problem = "" if process.returncode in (-9, 0) else errors.strip()[-200:]
            yield f"SIGKILL at a {kind}", problem or torture.goes_on()
        else:
            process = torture.start(workers=dice.choice([1, 2]))
            time.sleep(dice.uniform(0.2, torture.seconds))
            process.kill()
            process.communicate()
            yield "SIGKILL at a random time", torture.goes_on()


def questions(torture: Torture, count: int) -> Results:
    """Kill runs of `iqtt make-split` at random times, and let the same command go on."""
    folder = torture.folder / "questions"
    folder.mkdir()
    split, dice = Torture(folder, QUESTIONS), random.Random(2)
    for _ in range(min(count, 9)):
        split.fresh("killed")
        process = split.start()
        time.sleep(dice.uniform(0.3, 1) * split.seconds)
        process.kill()
        process.communicate()
        problem = split.goes_on() or split.left_behind()
        yield "SIGKILL of iqtt make-split at a random time", problem


def signals(torture: Torture, count: int) -> Results:
    """End runs by the signals that ask for it, in the midst of their shards."""
    dice = random.Random(1)
    for number in range(min(count, 9)):
        kind = (signal.SIGTERM, signal.SIGHUP, signal.SIGINT)[number % 3]
        torture.fresh("stopped")
        process = torture.start(workers=2)
        torture.under_way(process)
        time.sleep(dice.uniform(0, torture.seconds / 4))
        start = time.perf_counter()
        process.send_signal(kind)
        process.communicate()
        seconds = time.perf_counter() - start
        problem = "" if seconds < 2 else f"it took {seconds:.1f} s"
        yield (
            f"{kind.name}, ended within 2 s",
            problem or torture.left_behind() or torture.goes_on(),
        )


def refused(torture: Torture, name: str, mend: Callable[[], Any], **options: Any) -> Results:
    """Run a command that must be refused in one line; mend what was wrong, and let it go on."""
    yield name, torture.ended(torture.start(**options))
    mend()
    yield f"{name}: then mended", torture.goes_on()


def disk(torture: Torture, _count: int) -> Results:
    """Let the disk refuse: a limit on files, a full one, one that is read-only."""

    def limit() -> None:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, 200_000))

    torture.fresh("quota")
    name = "a limit on the size of files"
    yield from refused(torture, name, lambda: None, preexec_fn=limit)
    for name, before, after in (
        ("a full disk (a tmpfs of 2 MB)", "size=2m", "size=64m"),
        ("a read-only folder (a tmpfs)", "ro", "rw"),
    ):
        where = torture.fresh("mounted")
        if _mount("-t", "tmpfs", "-o", before, "none", where):
            yield name, "not tried: cannot mount"
            continue
        try:
            mend = lambda where=where, after=after: _mount("-o", f"remount,{after}", where)  # noqa: E731
            yield from refused(torture, name, mend)
        finally:
            subprocess.run(["umount", where], check=True)


def _mount(*words: str | Path) -> int:
    return subprocess.run(["mount", *words], check=False).returncode


def folders(torture: Torture, _count: int) -> Results:
    """Start a second run of the same set; let the folder vanish."""
    torture.fresh("shared")
    first = torture.start()
    torture.under_way(first)
    problem = torture.ended(torture.start())
    first.communicate()
    yield "a second run of the same set", problem or torture.other_bytes()
    where = torture.fresh("vanishing")
    process = torture.start()
    torture.under_way(process)
    shutil.rmtree(where, ignore_errors=True)
    yield "a folder that vanishes", torture.ended(process)


def streams(torture: Torture, _count: int) -> Results:
    """Close the streams that a command writes to; its files must not suffer."""
    for stream, number in (("stdout", 1), ("stderr", 2)):
        torture.fresh("streams")
        reading, writing = os.pipe()
        os.close(reading)
        process = torture.start(**{"stderr": subprocess.DEVNULL, stream: writing})
        os.close(writing)
        problem = torture.ended(process, 0) or torture.other_bytes()
        yield f"{stream}, a pipe whose reader is gone", problem
        torture.fresh("streams")
        close = lambda number=number: os.close(number)  # noqa: E731
        process = torture.start(stderr=subprocess.DEVNULL, preexec_fn=close)
        problem = torture.ended(process, 0) or torture.other_bytes()
        yield f"{stream}, closed before the start", problem


def cluster(torture: Torture, _count: int) -> Results:
    """Kill two of three workers of a cluster in the midst of runs, which go on by themselves."""
    from distributed import LocalCluster

    for shards in (1, 3, 5):
        address = "127.0.0.1:0"
        with LocalCluster(n_workers=3, threads_per_worker=1, dashboard_address=address) as workers:
            torture.fresh("cluster")
            process = torture.start("--scheduler", workers.scheduler_address)
            running = torture.under_way(process, shards)
            for nanny in list(workers.workers.values())[:2]:
                os.kill(nanny.pid, signal.SIGKILL)
            problem = torture.ended(process, 0) or torture.other_bytes()
            problem = problem or ("" if running else "it was done before")
            yield "a cluster of 3 workers, 2 of them killed", problem
