"""How fast questions are made, beside one Mitsuba render an image: one Markdown table.

`python -m benchmarks.questions [--quick]`, from the repository's root; processes as in
`benchmarks.render`. Writes to a temporary folder only.
"""

import argparse
import tempfile
from dataclasses import dataclass
from pathlib import Path

from benchmarks.report import Row, print_machine, print_table
from benchmarks.session import Session


@dataclass(frozen=True)
class Sizes:
    """How many questions each row takes, and how often."""

    totals: tuple[int, ...]
    cast: int
    plain: int
    repeats: int


FULL = Sizes(totals=(1000, 5000, 25000), cast=64, plain=50, repeats=3)
QUICK = Sizes(totals=(1000,), cast=64, plain=10, repeats=2)
PAPER_IMAGES = 1_200_000


def main() -> None:
    """Measure everything and print it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="fewer questions")
    sizes = QUICK if parser.parse_args().quick else FULL
    with tempfile.TemporaryDirectory(prefix="bench-") as folder:
        session = Session(Path(folder))
        print_machine(session.run("ours:machine"))
        rows = measure(session, sizes)
    print_table(rows, "128x128, colour only", NOTES)
    print_ratios(rows)


NOTES = (
    "MiB: peak memory of the process. Plain Mitsuba has its meshes and lights made beforehand,\n"
    "writes no file and refuses no view; its light has no ambient part."
)


def measure(session: Session, sizes: Sizes) -> dict[str, Row]:
    """Run the jobs."""
    rows = {}
    for count in sizes.totals:
        rows[f"ours {count}"] = Row(
            f"iqtt make-split, end to end to closed files, {count:,} questions",
            session.run(
                "polycubes:end_to_end",
                questions=count,
                repeats=sizes.repeats if count < 10_000 else 1,
                folder=str(session.folder),
            ),
        )
    for name, blocks in (("the cubes' kernel", True), ("the general kernel", False)):
        result = session.run(
            "polycubes:cast", questions=sizes.cast, repeats=10 * sizes.repeats, blocks=blocks
        )
        rows[name] = Row(f"pixels alone, {name}", result)
    for variant in ("scalar_rgb", "llvm_ad_rgb"):
        result = session.run(
            "polycubes:per_image", questions=sizes.plain, repeats=sizes.repeats, variant=variant
        )
        rows[f"plain {variant}"] = Row(f"load_dict + render an image, {variant}", result)
    return rows


def print_ratios(rows: dict[str, Row]) -> None:
    """Print what the rows say of each other, by their best repeats."""
    ours = max(row.best for key, row in rows.items() if key.startswith("ours"))
    plain = max(row.best for key, row in rows.items() if key.startswith("plain"))
    if not ours or not plain:
        return
    general, cubes = rows["the general kernel"].best, rows["the cubes' kernel"].best
    print("\nRatios of the best repeats:\n")
    print(f"- make-split / plain Mitsuba, the faster variant: {ours / plain:.1f}")
    if general and cubes:
        print(f"- the cubes' kernel / the general kernel: {cubes / general:.1f}")
    slowest = min(row.best for key, row in rows.items() if key.startswith("ours"))
    print(
        f"- the paper's {PAPER_IMAGES:,} images at the slowest rate above:"
        f" {PAPER_IMAGES / slowest / 60:.0f} minutes; goal: under 30 (700 images/s)"
    )


if __name__ == "__main__":
    main()
