"""A case of `benchmarks.torture`: splits of questions in shards, whose runs are killed."""

import random
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

from benchmarks.torture.runs import Torture, contents

WORDS = (
    "make-split --out split --train 120 --labeled 50 --val 30 --test 60 --shard-size 20 --seed 3"
    " --size 32 --min-cube-pixels 1 --cubes 6-8"
)


def questions(torture: Torture, count: int) -> Iterator[tuple[str, str]]:
    """Kill runs of `iqtt make-split` at random times, and let the same command go on."""

    def command(where: Path) -> "subprocess.Popen[str]":
        code = "import cli; cli.iqtt()"
        words = [sys.executable, "-c", code, *WORDS.split(), "--workers", "1"]
        streams = {"stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE, "text": True}
        return subprocess.Popen(words, cwd=where, env=torture.environment, **streams)  # type: ignore[call-overload,no-any-return]

    where, dice, begun = torture.fresh("questions"), random.Random(2), time.perf_counter()
    command(where).communicate()
    seconds, expected = time.perf_counter() - begun, contents(where / "split")
    for _ in range(count):
        where = torture.fresh("questions")
        process = command(where)
        time.sleep(dice.uniform(0.3 * seconds, seconds))
        process.kill()
        process.communicate()
        done = (where / "split" / "iqtt-test.h5").exists()
        again = command(where)
        said = again.communicate()[1]
        same = contents(where / "split") == expected
        hidden = [path.name for path in (where / "split").glob(".*")]
        problem = "" if done or again.returncode == 0 else said.strip()[-200:]
        problem = problem or ("" if same else "other bytes") or ", ".join(hidden)
        torture.fresh("questions")
        yield "SIGKILL of iqtt make-split at a random time", problem
