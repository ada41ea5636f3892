"""Scores of rooms, as in Tables 1 and 2 of the paper: all methods on three kinds of rooms."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from benchmarks.results.markdown import NOTHING, shown, table
from benchmarks.results.steps import Step, bundled_mark, each, made, mark, record

# Test files, each of 300 scenes in five views, and files that means are taken from.
PRESETS = {
    "shapes-single": ("", "One basic shape"),
    "shapes": ("", "One to three basic shapes"),
    "shapenet": (
        "--object-split {split} ",
        "Two to four built-in objects, of models not trained on",
    ),
}
VIEWS = ("0", "5", "35", "55", "80")
HEADLINE = {"relief_iou": "relief IoU", "relief_correlation": "relief correlation"}
SKILLS = {
    "relief_iou": "skill in relief IoU",
    "relief_correlation": "skill in relief correlation",
    "chamfer": "skill in CD",
    "hausdorff": "skill in HD",
    "mse_depth": "skill in MSE",
}
RAW = {
    "chamfer": "CD",
    "hausdorff": "HD",
    "hausdorff_forward": "HD-F",
    "hausdorff_reverse": "HD-R",
    "mse_depth": "MSE-depth",
}


@dataclass(frozen=True)
class Method:
    """A row of the table.

    Attributes:
        name: as in `bench baseline NAME`.
        options: of that command, besides --data and --out; {train} is a training file.
        presets: the rooms that it is for.
    """

    name: str
    options: str = ""
    presets: tuple[str, ...] = tuple(PRESETS)


METHODS = (
    Method("oracle"),
    Method("depth-supervised"),
    Method("view-pairs"),
    Method("pix2shape-rays", presets=("shapes", "shapenet")),
    Method("pix2shape", presets=("shapes-single", "shapes")),
    Method("pix2shape-compact"),
    Method("ptn"),
    Method("empty-room"),
    Method("mean-depth", "--train {train}"),
    Method("constant", "--train {train}"),
)


def data(preset: str) -> dict[str, Step]:
    """Return how the files of a preset are made: "test" and "train"."""
    options, _ = PRESETS[preset]
    told = "--preset {preset} {options}--n {n} {views}--seed {seed} --size 64 --out {out}"
    sizes = {"test": (300, "--views 0,5,35,55,80 ", 1000), "train": (20_000, "", 1)}
    steps = {}
    for split, (count, views, seed) in sizes.items():
        out = f"{split}-{preset}.h5"
        kinds = {"options": options.format(split=split), "n": count, "views": views, "seed": seed}
        command = f"scenegen render {told.format(preset=preset, out=out, **kinds)}"
        steps[split] = Step(command, out)
    return steps


def run(folder: Path, methods: Sequence[str]) -> list[str]:
    """Score all methods that are not scored yet; return what failed."""
    wanted = [method for method in METHODS if not methods or method.name in methods]
    cells = [(preset, m) for preset in PRESETS for m in wanted if preset in m.presets]
    return each(
        (f"{method.name}, {preset}", partial(_cell, folder, method, preset))
        for preset, method in cells
    )


def _cell(folder: Path, method: Method, preset: str) -> dict[str, Any]:
    """Return the scores of a method on the test file of a preset."""
    steps = data(preset)
    reads = ["test", *["train"] * ("{train}" in method.options)]
    for name in reads:
        made(folder, steps[name])
    files = tuple(steps[name].makes for name in reads)
    settings = {
        "method": method.name,
        "options": method.options,
        "files": {path: mark(folder / path) for path in files},
        "bundled": bundled_mark(method.name),
    }

    def score() -> dict[str, Any]:
        out, result = f"{method.name}-{preset}.h5", f"{method.name}-{preset}-scores.json"
        options = method.options.format(train=steps["train"].makes)
        told = f"{options} " if options else ""
        # Weights that come with the package are no file of this folder: predict anew.
        (folder / f"{out}.made.json").unlink(missing_ok=True)
        command = f"bench baseline {method.name} --data {files[0]} {told}--out {out}"
        made(folder, Step(command, out, files))
        command = f"bench score {out} --truth {files[0]} --json {result}"
        made(folder, Step(command, result, (out, files[0])))
        (folder / out).unlink()  # hundreds of megabytes
        scores = json.loads((folder / result).read_text())
        kept = ("metrics", "skills", "by_view_angle")
        return {name: scores.get(name, {}) for name in kept}

    return record(_place(folder, method.name, preset), settings, score)


def _place(folder: Path, method: str, preset: str) -> Path:
    return folder / "scores" / f"rooms-{method}-{preset}.json"


def page(folder: Path) -> str:
    """Return the tables of all presets, as far as they are scored."""
    return "\n\n".join(text for preset in PRESETS if (text := _section(folder, preset)))


def _section(folder: Path, preset: str) -> str:
    paths = {method.name: _place(folder, method.name, preset) for method in METHODS}
    scored = {
        name: json.loads(path.read_text())["scores"]
        for name, path in paths.items()
        if path.exists()
    }
    if not scored:
        return ""
    title = f"### {PRESETS[preset][1]}: test-{preset}.h5"
    rows = [
        [
            f"`{name}`",
            *(shown(scores["metrics"].get(key)) for key in HEADLINE),
            *(shown(scores["skills"].get(key)) for key in SKILLS),
        ]
        for name, scores in scored.items()
    ]
    first = table(["method", *HEADLINE.values(), *SKILLS.values()], rows)
    head = ["degrees", "method", "relief IoU", *RAW.values()]
    rows = []
    for angle in VIEWS:
        found = {name: scores["by_view_angle"].get(angle, {}) for name, scores in scored.items()}
        for name, scores in found.items():
            cells = [shown(scores.get("relief_iou")), *(shown(scores.get(key), 4) for key in RAW)]
            if any(cell != NOTHING for cell in cells):
                rows.append([angle, f"`{name}`", *cells])
    return f"{title}\n\n{first}\n\n{table(head, rows, texts=2)}"
