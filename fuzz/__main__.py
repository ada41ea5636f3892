"""The command line of the fuzzer; see the package."""

import os
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import click

from fuzz.cases import Case
from fuzz.child import working_folder
from fuzz.programs import TARGETS, Target
from fuzz.runner import Bench, Tally, honest_files, try_case, work

Known = Sequence[tuple[str, Case]]
REGRESSIONS = Path(__file__).parent / "regressions.jsonl"


@click.command()
@click.option("--seconds", type=float, default=600, show_default=True, help="How long to go on.")
@click.option("--cases", type=int, help="Number of cases of each target  [as time allows].")
@click.option("--seed", type=int, default=0, show_default=True, help="Seed of every random choice.")
@click.option("--only", multiple=True, help="A target, or the beginning of its name.")
@click.option("--first", type=int, default=0, show_default=True, help="Number of the first case.")
@click.option("--jobs", type=int, default=os.cpu_count(), help="Processes  [one a core].")
@click.option("--corpus", type=Path, help="Folder to keep cases with faults in.")
@click.option("--honest", type=Path, help="Folder of honest files  [made anew].")
@click.option(
    "--replay", type=Path, multiple=True, help="Run cases of a file of JSON lines instead."
)
def main(
    seconds: float,
    cases: int | None,
    seed: int,
    only: tuple[str, ...],
    first: int,
    jobs: int,
    corpus: Path | None,
    honest: Path | None,
    replay: tuple[Path, ...],
) -> None:
    """Run commands on hostile input, cases that were once faults first; exit with 1 at a fault."""
    targets = [t for t in TARGETS if not only or t.name.startswith(only)]
    with working_folder() as made:
        bench = (
            Bench(honest) if honest else honest_files(made, any(t.imports_torch for t in targets))
        )
        read = [case for file in (replay or [REGRESSIONS]) for case in read_cases(file)]
        known = [(f"known case {i} of {case.target}", case) for i, case in enumerate(read)]
        tally = Tally()
        for imports_torch in (False, True):
            some = [target for target in targets if target.imports_torch is imports_torch]
            if not some:
                continue
            bench.warm_up(some)
            names = {target.name for target in some}
            mine = [(name, case) for name, case in known if case.target in names]
            share = seconds * len(some) / len(targets)
            number = 0 if replay else cases
            tally.merge(in_parallel(bench, some, mine, seed, first, number, share, jobs, corpus))
    for line in tally.lines():
        click.echo(line)
    sys.exit(1 if tally.faults else 0)


def read_cases(path: Path) -> list[Case]:
    """Read the cases of a file: one a line."""
    return [Case.from_json(line) for line in path.read_text().splitlines() if line.strip()]


def replayed(bench: Bench, known: Known, corpus: Path | None) -> Tally:
    """Run known cases."""
    tally = Tally()
    for name, case in known:
        for line in try_case(bench, tally, name, case, corpus):
            click.echo(f"{name}: {line}", err=True)
    return tally


def in_parallel(
    bench: Bench,
    targets: list[Target],
    known: Known,
    seed: int,
    first: int,
    cases: int | None,
    seconds: float,
    jobs: int,
    corpus: Path | None,
) -> Tally:
    """Share known cases, then new ones, among processes that are forked from this one."""
    total = Tally()
    with working_folder() as results:
        children = []
        for job in range(jobs):
            child = os.fork()
            if child == 0:
                numbers = range(first + job, first + (10**9 if cases is None else cases), jobs)
                code = 1
                try:
                    tally = replayed(bench, known[job::jobs], corpus)
                    until = time.monotonic() + seconds
                    tally.merge(work(bench, targets, seed, numbers, until, corpus))
                    (results / str(job)).write_text(tally.to_json())
                    code = 0
                finally:
                    sys.stderr.flush()
                    os._exit(code)
            children.append(child)
        for job, child in enumerate(children):
            _, status = os.waitpid(child, 0)
            if os.waitstatus_to_exitcode(status):
                raise RuntimeError(f"job {job} of the fuzzer itself failed")
            total.merge(Tally.from_json((results / str(job)).read_text()))
    return total


if __name__ == "__main__":
    main()
