"""The command line of the fuzzer; see the package."""

import itertools
import os
import sys
import time
from pathlib import Path

import click

from fuzz.cases import Case, drawn
from fuzz.child import working_folder
from fuzz.programs import TARGETS, WITH_TORCH
from fuzz.runner import Tally, honest_files, trying, warm_up

REGRESSIONS = Path(__file__).parent / "regressions.jsonl"


@click.command()
@click.option("--seconds", type=float, default=600, show_default=True, help="How long to go on.")
@click.option("--cases", type=int, help="Number of cases of each target  [as time allows].")
@click.option("--seed", type=int, default=0, show_default=True, help="Seed of every random choice.")
@click.option("--only", multiple=True, help="A target, or the beginning of its name.")
@click.option("--jobs", type=int, default=os.cpu_count(), help="Processes  [one a core].")
@click.option("--corpus", type=Path, help="Folder to keep cases with faults in.")
@click.option("--replay", type=Path, multiple=True, help="Run cases of a file of JSON lines.")
def main(
    seconds: float,
    cases: int | None,
    seed: int,
    only: tuple[str, ...],
    jobs: int,
    corpus: Path | None,
    replay: tuple[Path, ...],
) -> None:
    """Run commands on hostile input, cases that were once faults first; exit with 1 at a fault."""
    targets = [name for name in TARGETS if not only or name.startswith(only)]
    known = [case for file in (replay or [REGRESSIONS]) for case in read_cases(file)]
    tally = Tally(corpus)
    with working_folder() as honest:
        honest_files(honest, any(name in WITH_TORCH for name in targets))
        for with_torch in (False, True):
            group = [name for name in targets if (name in WITH_TORCH) is with_torch]
            if not group:
                continue
            with trying(honest, warm_up(honest, group), jobs) as outcomes:
                until = time.monotonic() + seconds * len(group) / len(targets)
                named = [(f"known {case.target}", case) for case in known if case.target in group]
                for outcome in outcomes(named):
                    tally.add(outcome)
                for number in (
                    () if replay else itertools.count() if cases is None else range(cases)
                ):
                    if time.monotonic() > until:
                        break
                    drawn_cases = [
                        (f"{name} {seed} {number}", drawn(name, seed, number, honest))
                        for name in group
                    ]
                    for outcome in outcomes(drawn_cases):
                        tally.add(outcome)
    tally.print()
    sys.exit(1 if tally.faults else 0)


def read_cases(path: Path) -> list[Case]:
    """Read the cases of a file: one a line."""
    return [Case.from_json(line) for line in path.read_text().splitlines() if line.strip()]


if __name__ == "__main__":
    main()
