"""How fast questions are made, beside one Mitsuba render an image: one Markdown table.

`python -m benchmarks.questions [--quick]`, from the repository's root.
"""

from collections.abc import Iterator

from benchmarks.report import Job, Row, print_report

PAPER_IMAGES = 1_200_000
NOTES = (
    "MiB: peak memory of the process. Plain Mitsuba has its meshes and lights made beforehand,\n"
    "writes no file and refuses no view; its light has no ambient part."
)


def jobs(folder: str, quick: bool) -> Iterator[Job]:
    """Yield the jobs."""
    plain, repeats = (10, 2) if quick else (50, 3)
    for count in (1000,) if quick else (1000, 5000, 25000):
        how = {"questions": count, "repeats": repeats if count < 10_000 else 1, "folder": folder}
        what = f"iqtt make-split, end to end to closed files, {count:,} questions"
        yield f"ours {count}", what, "questions:end_to_end", how
    for name, blocks in (("the cubes' kernel", True), ("the general kernel", False)):
        how = {"questions": 64, "repeats": 10 * repeats, "blocks": blocks}
        yield name, f"pixels alone, {name}", "questions:cast", how
    for variant in ("scalar_rgb", "llvm_ad_rgb"):
        how = {"questions": plain, "repeats": repeats, "variant": variant}
        what = f"load_dict + render an image, {variant}"
        yield f"plain {variant}", what, "questions:per_image", how


def print_ratios(rows: dict[str, Row]) -> None:
    """Print how much faster than plain Mitsuba we are, and how long the paper's split takes."""
    ours = [row.best for key, row in rows.items() if key.startswith("ours")]
    plain = max(row.best for key, row in rows.items() if key.startswith("plain"))
    general, cubes = rows["the general kernel"].best, rows["the cubes' kernel"].best
    if not min(ours) or not plain:
        return
    print(f"- make-split / plain Mitsuba, the faster variant: {max(ours) / plain:.1f}; goal 3")
    if general and cubes:
        print(f"- the cubes' kernel / the general kernel: {cubes / general:.1f}")
    print(
        f"- the paper's {PAPER_IMAGES:,} images at the slowest rate above:"
        f" {PAPER_IMAGES / min(ours) / 60:.0f} minutes; goal: at most 12"
    )


if __name__ == "__main__":
    print_report(__doc__, jobs, "128x128, colour only", NOTES, print_ratios)
