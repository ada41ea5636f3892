"""How fast rooms are rendered, beside plain Mitsuba and the bare ray cast: one Markdown table.

`python -m benchmarks.render [--quick]`, from the repository's root. Every row is measured in a
process of its own. This one imports nothing heavy, as a child's peak of memory is never counted
lower than what its parent held when it started the child. Writes to a temporary folder only.
"""

import argparse
import statistics
import sys
import sysconfig
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.report import Row, print_machine, print_ratios, print_table
from benchmarks.session import Session

VARIANTS = ("llvm_ad_rgb", "scalar_rgb")
HELP_RUNS = 10
NOTES = (
    "MiB: peak memory of the process. (a) writes no file and makes no ids, its kernels are\n"
    "compiled beforehand, and the fastest of three ways to load the objects counts; its\n"
    "coarse meshes, about 1,000 triangles, show. (c) evaluates nothing but t and an id."
)


@dataclass(frozen=True)
class Sizes:
    """How many images each row takes, and how often."""

    totals: tuple[int, ...]
    scenes: int
    per_scene: int
    repeats: int


FULL = Sizes(totals=(1000, 5000, 20000), scenes=1000, per_scene=100, repeats=5)
QUICK = Sizes(totals=(1000,), scenes=256, per_scene=8, repeats=2)


def main() -> None:
    """Measure everything and print it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="fewer images, N = 1000 only")
    sizes = QUICK if parser.parse_args().quick else FULL
    with tempfile.TemporaryDirectory(prefix="bench-") as folder:
        session = Session(Path(folder))
        print_machine(session.run("ours:machine"))
        rows = measure(session, sizes)
        help_shown = start_up(session)
    print_table(rows, "128x128, depth and normals", NOTES)
    print_ratios(rows)
    print(f"\n`scenegen --help`: {help_shown}")


def measure(session: Session, sizes: Sizes) -> dict[str, Row]:
    """Run the jobs; the first makes the file whose scenes all the others take."""
    rooms = str(session.folder / "rooms.h5")
    rows: dict[str, Row] = {}

    def add(key: str, what: str, job: str, **arguments: Any) -> None:
        rows[key] = Row(what, session.run(job, **arguments))

    first, *larger = sizes.totals
    add(
        "b",
        f"(b) scenegen, end to end to a closed file, N = {first:,}",
        "ours:end_to_end",
        rooms=rooms,
        count=first,
        repeats=sizes.repeats,
    )
    shared = {"rooms": rooms, "count": sizes.scenes, "repeats": sizes.repeats}
    add("stage", "(b) scenegen, rendering stage alone", "ours:stage", **shared)
    add("c1", "(c) bare cast, unit scene", "bare_cast:unit_scene", **shared)
    add("c2", "(c) bare cast, lattice of instances", "bare_cast:lattice", **shared)
    for coarse in (False, True):
        for variant in VARIANTS:
            add(
                f"a {variant} {'coarse' if coarse else 'same'}",
                f"(a) load_dict + render, {variant}, {'coarse' if coarse else 'the same'} meshes",
                "plain_mitsuba:per_scene",
                rooms=rooms,
                count=sizes.per_scene,
                repeats=min(sizes.repeats, 3),
                variant=variant,
                coarse=coarse,
                folder=str(session.folder),
            )
    for count in larger:
        add(
            f"b {count}",
            f"(b) scenegen, end to end, N = {count:,}",
            "ours:end_to_end",
            rooms=rooms,
            count=count,
            repeats=1,
        )
    return rows


def start_up(session: Session) -> str:
    """Time the console script, or its function where it is not installed."""
    script = Path(sysconfig.get_path("scripts")) / "scenegen"
    call = "import cli; cli.scenegen(['--help'])"
    command = [str(script), "--help"] if script.exists() else [sys.executable, "-c", call]
    bare = [sys.executable, "-c", "pass"]
    if session.seconds(command) is None:
        return "does not run"
    runs = [(session.seconds(command), session.seconds(bare)) for _ in range(HELP_RUNS)]
    ours, python = (statistics.median(times) for times in zip(*runs, strict=True))
    return (
        f"{ours:.2f} s, median of {HELP_RUNS} runs (Python alone: {python:.2f} s);"
        f" goal: under 0.3 s"
    )


if __name__ == "__main__":
    main()
