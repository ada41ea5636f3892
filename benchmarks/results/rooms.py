"""Scores of rooms, as in Tables 1 and 2 of the paper: all methods on three kinds of rooms."""

from collections.abc import Iterator, Sequence
from pathlib import Path

from benchmarks.markdown import table
from benchmarks.results.rows import Row, cells, scores, steps
from benchmarks.results.steps import Step

PRESETS = {
    "shapes-single": "One basic shape",
    "shapes": "One to three basic shapes",
    "shapenet": "Two to four built-in objects, of models not trained on",
}
# Test files of 300 scenes in five views, and training files for means.
FILES = {"test": "--n 300 --views 0,5,35,55,80 --seed 1000", "train": "--n 20000 --seed 1"}
ANGLES = ("0", "5", "35", "55", "80")
METHODS = (
    "oracle", "depth-supervised", "depth-completed", "view-pairs", "pix2shape-rays", "pix2shape",
    "ptn", "empty-room", "mean-depth", "constant",
)  # fmt: skip
NOT_FOR = {"pix2shape-rays": "shapes-single", "pix2shape": "shapenet"}
LEARN_MEANS = ("mean-depth", "constant")
SCORES = {"relief_iou": "relief IoU", "relief_correlation": "relief correlation"}
SKILLS = {
    "relief_iou": "skill in relief IoU",
    "relief_correlation": "skill in relief correlation",
    "chamfer": "skill in CD",
    "hausdorff": "skill in HD",
    "mse_depth": "skill in MSE",
}
AT_ANGLES = {
    "relief_iou": "relief IoU",
    "chamfer": "CD",
    "hausdorff": "HD",
    "hausdorff_forward": "HD-F",
    "hausdorff_reverse": "HD-R",
    "mse_depth": "MSE-depth",
}


def rows(preset: str) -> Iterator[tuple[str, Row]]:
    """Yield the method and the row of each line of a preset's tables."""
    for name in METHODS:
        if NOT_FOR.get(name) != preset:
            data = f"train-{preset}.h5" if name in LEARN_MEANS else ""
            train = " --train {data}" if data else ""
            predict = f"bench baseline {name} --data {{test}}{train} --out {{out}}"
            yield name, Row(name, predict, data=data, most_seeds=1)


def plan(names: Sequence[str], seeds: int) -> Iterator[Step]:
    """Yield all steps of the methods of these names, or of all. Every method has one run."""
    for preset in PRESETS:
        test = f"test-{preset}.h5"
        for name, row in rows(preset):
            if not names or name in names:
                for split in ("test", "train") if row.data else ("test",):
                    yield _rendering(preset, split)
                yield from steps(row, test, test, preset, seeds)


def _rendering(preset: str, split: str) -> Step:
    part = f" --object-split {split}" if preset == "shapenet" else ""
    options, out = f"--preset {preset}{part} --size 64 {FILES[split]}", f"{split}-{preset}.h5"
    return Step((f"scenegen render {options} --out {out}",), out)


def page(folder: Path) -> str:
    """Return the tables of all presets, as far as they are scored."""
    return "\n\n".join(filter(None, (_section(folder, preset) for preset in PRESETS)))


def _section(folder: Path, preset: str) -> str:
    files = {f"`{name}`": scores(folder, row, preset) for name, row in rows(preset)}
    scored = {name: file for name, file in files.items() if file}
    if not scored:
        return ""
    lines = [
        [name, *cells(file, "metrics", SCORES), *cells(file, "skills", SKILLS)]
        for name, file in scored.items()
    ]
    first = table(["method", *SCORES.values(), *SKILLS.values()], lines)
    lines = [
        [angle, name, *cells(file, angle, AT_ANGLES, 4)]
        for angle in ANGLES
        for name, file in scored.items()
    ]
    second = table(["degrees", "method", *AT_ANGLES.values()], lines, texts=2)
    return f"### {PRESETS[preset]}: test-{preset}.h5\n\n{first}\n\n{second}"
