"""Cases run one after the other, each in a child of a warm process; what they broke is kept.

`Bench` knows the honest files and what honest runs cost. `Tally` counts what cases did.
"""

import contextlib
import importlib
import json
import os
import re
import subprocess
import sys
import time
import zlib
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from fuzz.cases import Case, draw
from fuzz.child import Run, call, run, working_folder
from fuzz.programs import TARGETS, Target
from fuzz.verdict import Fault, faults, files_in

LIMIT = 10.0  # seconds
LEFT_OUT = ("mitsuba", "drjit")  # they start threads, which a child would miss
KEPT = 3  # cases kept of each distinct fault
HONEST = 300.0  # seconds that all honest runs together may take, from cold


@dataclass
class Bench:
    """The folder of honest files, and the largest memory of honest runs."""

    honest: Path
    megabytes: float = 0.0

    def warm_up(self, targets: Sequence[Target]) -> None:
        """Run the honest command lines in a child, and import in this process what they import."""
        with working_folder() as around:
            done = call(lambda: self._run_honest(targets, around), around, HONEST)
            if done.code != 0:
                raise RuntimeError(f"an honest command failed: {done.err.decode()}")
            names = (around / "modules").read_text().split("\n")
        self.megabytes = max(self.megabytes, done.megabytes)
        for name in names:
            if not name.startswith(LEFT_OUT):
                with contextlib.suppress(Exception):  # some modules cannot be imported alone
                    importlib.import_module(name)

    def _run_honest(self, targets: Sequence[Target], around: Path) -> None:
        import cli

        lines = [(line.split(), target.codes) for target in targets for line in target.lines]
        for i, ((program, *arguments), codes) in enumerate(lines):
            Case("", ()).put_up(self.honest, around / str(i))
            os.chdir(around / str(i))
            sys.argv = [program, *arguments]
            try:
                getattr(cli, program).main(arguments, prog_name=program)
            except SystemExit as end:
                if end.code not in (0, *codes):
                    raise RuntimeError(f"{sys.argv} ended with {end.code}") from end
        (around / "modules").write_text("\n".join(list(sys.modules)))

    def run(self, case: Case, limit: float = LIMIT) -> tuple[Run, list[Fault], list[str]]:
        """Run a case; return what came of it, its faults, and the edits that could not be made."""
        target = next(target for target in TARGETS if target.name == case.target)
        with working_folder() as around:
            folder = around / "work"
            unmade = case.put_up(self.honest, folder)
            before = files_in(folder)
            done = run(list(case.arguments), folder, limit, case.stdout)
            after = files_in(folder)
            found = faults(case, target, done, self.megabytes, before, after)
        return done, found, unmade

    def tried(self, case: Case, limit: float = LIMIT) -> tuple[Run, list[Fault], list[str]]:
        """Run a case, and again where its time was over: a busy machine is no fault of it."""
        found = self.run(case, limit)
        waiting = os.getloadavg()[0] / (os.cpu_count() or 1)  # programs for each core
        return self.run(case, limit * max(1, waiting)) if found[0].timed_out else found


@dataclass
class Tally:
    """What cases did: how many there were, how they ended, and what was dearest."""

    cases: Counter[str] = field(default_factory=Counter)
    codes: Counter[str] = field(default_factory=Counter)
    unmade: int = 0
    faults: Counter[str] = field(default_factory=Counter)
    seen: dict[str, str] = field(default_factory=dict)
    slowest: tuple[float, str] = (0.0, "")
    largest: tuple[float, str] = (0.0, "")

    def add(
        self, name: str, case: Case, done: Run, found: Sequence[Fault], unmade: int
    ) -> list[str]:
        """Count a case; return the distinct faults of which it is among the first."""
        self.cases[case.target] += 1
        self.codes[str(done.code)] += 1
        self.unmade += unmade
        self.slowest = max(self.slowest, (round(done.seconds, 2), name))
        self.largest = max(self.largest, (round(done.megabytes), name))
        new = []
        for fault in found:
            key = distinct(case, fault)
            self.faults[key] += 1
            self.seen.setdefault(key, f"{name}: {fault}")
            new += [key] if self.faults[key] <= KEPT else []
        return new

    def merge(self, other: "Tally") -> None:
        """Add the counts of another tally."""
        for mine, more in (
            (self.cases, other.cases),
            (self.codes, other.codes),
            (self.faults, other.faults),
        ):
            mine.update(more)
        self.unmade += other.unmade
        self.seen = {**other.seen, **self.seen}
        self.slowest = max(self.slowest, other.slowest)
        self.largest = max(self.largest, other.largest)

    def to_json(self) -> str:
        """Return the tally as JSON."""
        return json.dumps(vars(self))

    @staticmethod
    def from_json(text: str) -> "Tally":
        """Read a tally."""
        told = json.loads(text)
        for name in ("cases", "codes", "faults"):
            told[name] = Counter(told[name])
        for name in ("slowest", "largest"):
            told[name] = tuple(told[name])
        return Tally(**told)

    def lines(self) -> Iterator[str]:
        """Return the summary."""
        for name, count in self.cases.items():
            yield f"{name:14} {count:6} cases"
        yield f"{'all':14} {sum(self.cases.values()):6} cases; exit codes {dict(self.codes)}"
        yield f"{self.unmade} edits did not fit their file"
        yield f"slowest {self.slowest[0]} s: {self.slowest[1]}"
        yield f"largest {self.largest[0]} MB: {self.largest[1]}"
        for key, count in self.faults.most_common():
            yield f"FAULT {count:5} x {self.seen[key]}"
        yield f"{len(self.faults)} distinct faults in {sum(self.faults.values())} places"


def distinct(case: Case, fault: Fault) -> str:
    """Return a text that is the same for the same fault of other cases."""
    seen = re.sub(r"'[^']*'|\"[^\"]*\"|[0-9]+|\S*/\S*", "_", fault.seen)
    return f"{' '.join(case.arguments[:2])} {fault.kind}: {seen:.60}"


def keep(
    corpus: Path, name: str, case: Case, done: Run, found: Sequence[Fault], bench: Bench
) -> None:
    """Write a case with its faults and its files into a folder of the corpus."""
    import tarfile

    folder = corpus / re.sub(r"\W+", "-", name)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "case.json").write_text(case.to_json() + "\n")
    told = "\n".join(map(str, found))
    (folder / "faults.txt").write_text(f"{told}\n\n{done.err[-20_000:].decode(errors='replace')}")
    with working_folder() as around:
        case.put_up(bench.honest, around / "work")
        with tarfile.open(folder / "files.tar.xz", "w:xz") as packed:
            for path in sorted({edit[0] for edit in case.edits}):
                file = around / "work" / path
                if os.path.lexists(file) and file.lstat().st_size < 50_000_000:
                    packed.add(file, path)


def honest_files(folder: Path, weights: bool) -> Bench:
    """Make the honest files, in a process of their own as rendering starts threads."""
    more = ["--weights"] if weights else []
    done = subprocess.run(
        [sys.executable, "-m", "fuzz.honest", str(folder), *more],
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        raise RuntimeError(done.stderr[-2000:])
    return Bench(folder)


def try_case(bench: Bench, tally: Tally, name: str, case: Case, corpus: Path | None) -> list[str]:
    """Run and count a case, and keep its first faults; return the edits that could not be made."""
    done, found, unmade = bench.tried(case)
    for key in tally.add(name, case, done, found, len(unmade)):
        print(f"{name}: {key}", file=sys.stderr, flush=True)
        if corpus:
            keep(corpus, f"{name} {zlib.crc32(key.encode()):08x}", case, done, found, bench)
    return unmade


def work(
    bench: Bench,
    targets: Sequence[Target],
    seed: int,
    numbers: Iterable[int],
    until: float,
    corpus: Path | None,
) -> Tally:
    """Run case after case of all targets until a time of `time.monotonic`."""
    tally = Tally()
    for number, target in ((number, target) for number in numbers for target in targets):
        if time.monotonic() > until:
            break
        case = draw(target, seed, number, bench.honest)
        try_case(bench, tally, f"{target.name} {seed} {number}", case, corpus)
    return tally
