"""Runs that are killed, stopped, or meet trouble of many kinds, and then go on: one Markdown table.

`python -m benchmarks.torture [--kills 50] [--parts kills signals ...]`, from the repository's root.
Every run must end with the bytes of an unbroken run, and leave no temporary file. All is written
below one temporary folder, some 1.5 GB.
"""

import argparse
import sys
import tempfile
from collections import Counter
from functools import partial
from pathlib import Path

from tabulate import tabulate

from benchmarks.torture import cases
from benchmarks.torture.jobs import JOBS, growth, job
from benchmarks.torture.runs import Torture

PARTS = {
    "kills": cases.kills,
    "signals": cases.signals,
    "questions": cases.questions,
    "disk": cases.disk,
    "folders": cases.folders,
    "streams": cases.streams,
    "cluster": cases.cluster,
    "growth": growth,
    **{name: partial(job, name) for name in JOBS},
}


def main() -> None:
    """Print a row for each kind of trouble; exit with 1 if a run did not survive it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=list(PARTS))
    options = parser.parse_args()
    tried, survived = Counter[str](), Counter[str]()
    with tempfile.TemporaryDirectory(prefix="torture-") as name:
        torture = Torture(Path(name))
        for part in options.parts:
            for trouble, wrong in PARTS[part](torture, options.kills):
                problem = wrong or torture.left_behind()
                tried[trouble] += 1
                survived[trouble] += not problem
                print(f"{trouble}: {problem or 'survived'}", file=sys.stderr, flush=True)
    lines = [[name, str(tried[name]), str(survived[name])] for name in sorted(tried)]
    print(tabulate(lines, ["trouble", "runs", "survived"], "pipe", disable_numparse=True))
    print(f"\n{survived.total()} of {tried.total()} runs survived")
    sys.exit(survived != tried)


if __name__ == "__main__":
    main()
