"""How fast rooms are rendered, beside plain Mitsuba and the bare ray cast: one Markdown table.

`python -m benchmarks.render [--quick]`, from the repository's root.
"""

import re
import statistics
import sys
import sysconfig
from collections.abc import Iterator
from pathlib import Path

from benchmarks.report import Job, Row, Session, print_report

HELP_RUNS = 10
NOTES = (
    "MiB: peak memory of the process and its workers. (a) writes no file and makes no ids, its\n"
    "kernels are compiled beforehand, and the fastest of three ways to load the objects counts;\n"
    "its coarse meshes, about 1,000 triangles, show. (c) evaluates nothing but t and an id."
)
GOALS = (
    ("end to end / fastest (a)", "b", "a", 6.0),
    ("end to end / (c)", "b", "c", 0.45),
    ("rendering stage / (c)", "stage", "c", 0.75),
)


def jobs(folder: str, quick: bool) -> Iterator[Job]:
    """Yield the jobs; the first makes the file whose scenes all the others take."""
    rooms = f"{folder}/rooms.h5"
    first, *larger = (1000,) if quick else (1000, 5000, 20000, 100_000)
    scenes, per_scene, repeats = (256, 8, 2) if quick else (1000, 100, 5)
    whole = {"rooms": rooms, "count": first, "repeats": repeats}
    what = f"(b) scenegen, end to end to a closed file, N = {first:,}"
    yield "b", what, "rooms:end_to_end", whole
    shared = {"rooms": rooms, "count": scenes, "repeats": repeats}
    yield "stage", "(b) scenegen, rendering stage alone", "rooms:stage", shared
    what = "(b) scenegen, proposing scenes alone"
    yield "sampling", what, "rooms:sampling", {"count": 1000 if quick else 5000, "repeats": repeats}
    yield "c, unit scene", "(c) bare cast, unit scene", "bare_cast:unit_scene", shared
    yield "c, lattice", "(c) bare cast, lattice of instances", "bare_cast:lattice", shared
    plain = {"rooms": rooms, "count": per_scene, "repeats": min(repeats, 3), "folder": folder}
    for coarse, meshes in ((False, "the same"), (True, "coarse")):
        for variant in ("llvm_ad_rgb", "scalar_rgb"):
            what = f"(a) load_dict + render, {variant}, {meshes} meshes"
            how = {**plain, "variant": variant, "coarse": coarse}
            yield f"a {variant} {meshes}", what, "plain_mitsuba:per_scene", how
    for count in larger:
        what = f"(b) scenegen, end to end, N = {count:,}"
        more = {"count": count, "repeats": 3 if count < 10_000 else 1}
        yield f"b {count}", what, "rooms:end_to_end", {**whole, **more}
        if count == 5000:
            alone = {**whole, **more, "workers": 1}
            yield f"b {count} alone", f"{what}, --workers 1", "rooms:end_to_end", alone


def print_ratios(rows: dict[str, Row]) -> None:
    """Print the ratios that have goals, for both kinds of meshes and of casts."""
    best = {key: row.best for key, row in rows.items()}
    best["b"] = max(rate for key, rate in best.items() if re.fullmatch(r"b( [0-9]+)?", key))
    for meshes in ("same", "coarse"):
        rates = [rate for key, rate in best.items() if key.startswith("a ") and meshes in key]
        best[f"a, {meshes} meshes"] = max(rates)
    for what, over, under, goal in GOALS:
        for key in [key for key in best if key.startswith(f"{under}, ")]:
            if best[over] and best[key]:
                _, which = key.split(", ")
                print(f"- {what}, {which}: {best[over] / best[key]:.2f}; goal {goal}")


def print_start_up(session: Session) -> None:
    """Time the console script, or its function where it is not installed."""
    script = Path(sysconfig.get_path("scripts")) / "scenegen"
    call = "import cli; cli.scenegen(['--help'])"
    command = [str(script), "--help"] if script.exists() else [sys.executable, "-c", call]
    if session.timed(command)[1].returncode:
        print("\n`scenegen --help`: does not run")
        return
    ours, python = (
        statistics.median(session.timed(one)[0] for _ in range(HELP_RUNS))
        for one in (command, [sys.executable, "-c", "pass"])
    )
    told = f"{ours:.2f} s, median of {HELP_RUNS} runs (Python alone: {python:.2f} s)"
    print(f"\n`scenegen --help`: {told}; goal: under 0.3 s")


if __name__ == "__main__":
    print_report(__doc__, jobs, "128x128, depth and normals", NOTES, print_ratios, print_start_up)
