"""How fast scenes of models are rendered, beside one Mitsuba render a scene: one Markdown table.

`python -m benchmarks.models [--quick]`, from the repository's root; processes as in
`benchmarks.render`. The built-in objects, and a folder of meshes with 20,480 faces each that is
made here. Also what `--shading path` costs. Writes to a temporary folder only.
"""

import argparse
import tempfile
from dataclasses import dataclass
from pathlib import Path

from benchmarks.report import Row, print_machine, print_table
from benchmarks.session import Session

MESHES = 60  # models of 20,480 faces, in three classes
NOTES = (
    "MiB: peak memory of the process. The first run of a folder reads and cleans its meshes, the\n"
    "second finds them in the cache. Plain Mitsuba has its meshes in memory, writes no file and\n"
    "makes no ids; the faster of two ways to load them counts. The stage alone renders scenes\n"
    "that were sampled before; their models are kept from a first pass over them."
)


@dataclass(frozen=True)
class Sizes:
    """How many images each row takes, and how often."""

    families: tuple[int, ...]
    folder: int
    stage: int
    plain: int
    paths: int
    repeats: int


FULL = Sizes((1000, 5000, 20000), folder=2000, stage=512, plain=60, paths=64, repeats=3)
QUICK = Sizes((1000,), folder=256, stage=128, plain=8, paths=16, repeats=1)


def main() -> None:
    """Measure everything and print it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="fewer images")
    sizes = QUICK if parser.parse_args().quick else FULL
    with tempfile.TemporaryDirectory(prefix="bench-") as folder:
        session = Session(Path(folder))
        print_machine(session.run("ours:machine"))
        rows = measure(session, sizes)
    print_table(rows, "128x128, depth and normals", NOTES)
    print_ratios(rows)


def measure(session: Session, sizes: Sizes) -> dict[str, Row]:
    """Run the jobs."""
    rows: dict[str, Row] = {}
    root = str(session.folder / "meshes")
    session.run("ours:make_meshes", folder=root, count=MESHES)
    for key, what, where, totals in (
        ("shapenet", "built-in objects, 2-4 a scene", "", sizes.families),
        ("folder", "20,480-face meshes, 2-4 a scene", root, (sizes.folder, sizes.folder)),
    ):
        rooms = str(session.folder / f"{key}.h5")
        for run, count in enumerate(totals):
            nth = f", run {run + 1}" if where else ""
            rows[f"{key} {count} {run}"] = Row(
                f"scenegen, {what}, end to end, N = {count:,}{nth}",
                session.run(
                    "ours:from_nothing", rooms=rooms, count=count, preset="shapenet", root=where
                ),
            )
        shared = {"rooms": rooms, "repeats": sizes.repeats, "root": where}
        rows[f"{key} stage"] = Row(
            f"scenegen, {what}, rendering stage alone",
            session.run("ours:stage", count=sizes.stage, **shared),
        )
        for variant in ("llvm_ad_rgb", "scalar_rgb"):
            rows[f"{key} plain {variant}"] = Row(
                f"load_dict + render, {variant}, the same meshes",
                session.run(
                    "plain_mitsuba:per_scene",
                    count=sizes.plain,
                    variant=variant,
                    coarse=False,
                    folder=str(session.folder),
                    ways=["files", "merged"],
                    **shared,
                ),
            )
    for shading in ("paper", "path"):
        rows[shading] = Row(
            f"scenegen, basic shapes, --shading {shading}{', 64 samples' * (shading == 'path')}",
            session.run(
                "ours:from_nothing",
                rooms=str(session.folder / "shading.h5"),
                count=sizes.paths,
                preset="shapes",
                shading=shading,
            ),
        )
    return rows


def print_ratios(rows: dict[str, Row]) -> None:
    """Print what the rows say of each other, by their best repeats."""
    print("\nRatios of the best repeats:\n")
    for key, goal in (("shapenet", 8.0), ("folder", 4.0)):
        plain = max(row.best for name, row in rows.items() if name.startswith(f"{key} plain"))
        ours = {name: row for name, row in rows.items() if name.startswith(key)}
        for name, row in ours.items():
            if " plain" not in name and plain:
                print(f"- {row.what} / plain: {row.best / plain:.1f}; goal {goal:g}")
    if rows["path"].best:
        print(f"- --shading paper / path: {rows['paper'].best / rows['path'].best:.0f}")


if __name__ == "__main__":
    main()
