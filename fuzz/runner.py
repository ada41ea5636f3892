"""Cases run on all processors, each in a child of a warm process; what they broke is counted."""

import contextlib
import importlib
import os
import re
import subprocess
import sys
from collections import Counter
from collections.abc import Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from multiprocessing import get_context
from pathlib import Path

from fuzz.cases import Case
from fuzz.child import Run, call, run, working_folder
from fuzz.programs import CAN_FIND_FAULTS, TARGETS
from fuzz.verdict import faults, files_in

LIMIT = 10.0  # seconds
LEFT_OUT = ("mitsuba", "drjit")  # they start threads, which a child would miss
KEPT = 3  # cases kept of each distinct fault
HONEST = 300.0  # seconds that all honest runs together may take, from cold


@dataclass(frozen=True)
class Outcome:
    """What came of a case: its run, its faults (kind, what was seen), edits that did not fit."""

    name: str
    case: Case
    run: Run
    faults: Sequence[tuple[str, str]]
    unmade: Sequence[str]


def honest_files(folder: Path, weights: bool) -> None:
    """Make the honest files, in a process of their own as rendering starts threads."""
    command = [sys.executable, "-m", "fuzz.honest", str(folder), *["--weights"] * weights]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(done.stderr[-2000:])


def warm_up(honest: Path, targets: Iterable[str]) -> float:
    """Run the honest command lines in a child, and import in this process what they import.

    Returns:
        The largest memory of the honest runs, MB.
    """

    def run_all() -> None:
        import cli

        for target in targets:
            for number, line in enumerate(TARGETS[target]):
                folder = around / f"{target} {number}"
                Case("", ()).put_up(honest, folder)
                os.chdir(folder)
                program, *words = sys.argv = line.split()
                try:
                    getattr(cli, program).main(words, prog_name=program)
                except SystemExit as end:
                    if end.code not in (0, 1 if target in CAN_FIND_FAULTS else 0):
                        raise RuntimeError(f"{line} ended with {end.code}") from end
        (around / "modules").write_text("\n".join(sys.modules))

    with working_folder() as around:
        done = call(run_all, around, HONEST)
        if done.code != 0:
            raise RuntimeError(f"an honest command failed: {done.err.decode()}")
        names = (around / "modules").read_text().split("\n")
    for name in names:
        if not name.startswith(LEFT_OUT):
            with contextlib.suppress(Exception):  # some modules cannot be imported alone
                importlib.import_module(name)
    return done.megabytes


def try_case(honest: Path, megabytes: float, named: tuple[str, Case]) -> Outcome:
    """Run a case, and again where its time was over: a busy machine is no fault of it."""
    outcome = run_case(honest, megabytes, named, LIMIT)
    if outcome.run.timed_out:
        waiting = os.getloadavg()[0] / (os.cpu_count() or 1)  # programs for each core
        outcome = run_case(honest, megabytes, named, LIMIT * max(1, waiting))
    return outcome


def run_case(honest: Path, megabytes: float, named: tuple[str, Case], limit: float) -> Outcome:
    """Run a case once."""
    name, case = named
    with working_folder() as around:
        folder = around / "work"
        unmade = case.put_up(honest, folder)
        before = files_in(folder)
        done = run(list(case.arguments), folder, limit, case.stdout)
        problems = list(faults(case, done, megabytes, before, files_in(folder)))
    return Outcome(name, case, done, problems, unmade)


@contextlib.contextmanager
def trying(honest: Path, megabytes: float, jobs: int):  # type: ignore[no-untyped-def]
    """Give a function that tries cases on all processors and yields their outcomes in order."""
    with ProcessPoolExecutor(jobs, get_context("fork")) as pool:
        yield partial(pool.map, partial(try_case, honest, megabytes))


@dataclass
class Tally:
    """What cases did: how many there were, how they ended, and what was dearest."""

    corpus: Path | None = None
    cases: Counter[str] = field(default_factory=Counter)
    codes: Counter[int] = field(default_factory=Counter)
    unmade: int = 0
    faults: Counter[str] = field(default_factory=Counter)
    slowest: tuple[float, str] = (0.0, "")
    largest: tuple[float, str] = (0.0, "")

    def add(self, outcome: Outcome) -> None:
        """Count a case; print a fault where it is new, and keep its first cases in the corpus."""
        case, done = outcome.case, outcome.run
        self.cases[case.target] += 1
        self.codes[done.code] += 1
        self.unmade += len(outcome.unmade)
        for text in outcome.unmade:
            print(f"{outcome.name}: {text}", file=sys.stderr)
        self.slowest = max(self.slowest, (round(done.seconds, 2), outcome.name))
        self.largest = max(self.largest, (round(done.megabytes), outcome.name))
        for kind, seen in outcome.faults:
            alike = re.sub(r"'[^']*'|\"[^\"]*\"|[0-9]+|\S*/\S*", "_", seen)
            fault = f"{' '.join(case.arguments[:2])} {kind}: {alike:.60}"
            self.faults[fault] += 1
            if self.faults[fault] <= KEPT:
                print(f"{outcome.name}: {kind}: {seen}", file=sys.stderr, flush=True)
                self._keep(outcome)

    def _keep(self, outcome: Outcome) -> None:
        if self.corpus is None:
            return
        folder = self.corpus / re.sub(r"\W+", "-", outcome.name)
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "case.json").write_text(outcome.case.to_json() + "\n")
        seen = "\n".join(": ".join(fault) for fault in outcome.faults)
        error = outcome.run.err[-20_000:].decode(errors="replace")
        (folder / "faults.txt").write_text(f"{seen}\n\n{error}")

    def print(self) -> None:
        """Print the summary."""
        for name, count in self.cases.items():
            print(f"{name:14} {count:6} cases")
        print(f"{'all':14} {self.cases.total():6} cases; exit codes {dict(self.codes)}")
        print(f"{self.unmade} edits did not fit their file")
        print(f"slowest {self.slowest[0]} s: {self.slowest[1]}")
        print(f"largest {self.largest[0]} MB: {self.largest[1]}")
        for fault, count in self.faults.most_common():
            print(f"FAULT {count:5} x {fault}")
        print(f"{len(self.faults)} distinct faults in {self.faults.total()} places")
