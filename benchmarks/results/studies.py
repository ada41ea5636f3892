"""The paper's ablations: what each loss brings, depth supervision, and the weight of information.

A study compares settings of the reference model, each trained with several seeds from the same
file, and scored on the same test file. Its table shows means over seeds, and their spread.
"""

import json
import statistics
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from benchmarks.results.markdown import NOTHING, table
from benchmarks.results.steps import Step, each, made, mark, record

HOUSEHOLD = "--preset shapenet --object-split {split}"
SHAPES = "--preset shapes"
QUESTIONS = Step(
    "iqtt make-split --distractors other --train 12000 --labeled 1000 --val 0 --test 2000"
    " --out study-questions",
    "study-questions",
)
ANGLES = ("0", "5", "35", "55", "80")
NO_LOSS = "reconstruction=0 code_reconstruction=0 consistency=0 mutual_information=0 contrast=0"
RECONSTRUCTION = "reconstruction=1 code_reconstruction=1 absolute_differences=false"
INFORMATION = (0.1, 0.4, 0.6, 0.8, 1.0)


@dataclass(frozen=True)
class Study:
    """What is compared.

    Attributes:
        title: above the table.
        data: what makes the training file and the test file.
        train, test, truth: paths of these files, and of that with the answers.
        rows: what each row is called, and its settings as `--set` takes them.
        options: of `pix2shape train`, for all rows.
        scores: names of the columns, and where their figures are in a file of scores; a name like
            "CD, 35°" is that of a column of its own table line for each view.
        floors: rows that nothing is trained for, as in `bench baseline NAME`.
    """

    title: str
    data: tuple[Step, ...]
    train: str
    test: str
    truth: str
    rows: dict[str, str]
    options: str
    scores: dict[str, tuple[str, ...]]
    floors: tuple[str, ...]


def _by_angle(metric: str, name: str) -> dict[str, tuple[str, ...]]:
    return {f"{name}, {angle}°": ("by_view_angle", angle, metric) for angle in ANGLES}


def _of_rooms(
    title: str,
    rows: dict[str, str],
    rooms: str = HOUSEHOLD,
    files: str = "study",
    options: str = "--set iterations=1000",
) -> Study:
    scores = {
        **_by_angle("relief_iou", "relief IoU"),
        **_by_angle("chamfer", "CD"),
        **_by_angle("hausdorff_forward", "HD-F"),
        **_by_angle("hausdorff_reverse", "HD-R"),
        **_by_angle("mse_depth", "MSE-depth"),
    }
    train, test = f"{files}-train.h5", f"{files}-test.h5"
    made = {
        train: f"{rooms.format(split='train')} --size 64 --n 8000 --seed 1",
        test: f"{rooms.format(split='test')} --size 64 --n 300 --views 0,5,35,55,80 --seed 1000",
    }
    data = tuple(
        Step(f"scenegen render {words} --out {name}", name) for name, words in made.items()
    )
    return Study(title, data, train, test, test, rows, options, scores, ("empty-room",))


def _of_questions(title: str, rows: dict[str, str], labels: int) -> Study:
    folder = "study-questions/iqtt-"
    files = (f"{folder}train.h5", f"{folder}test.h5", f"{folder}test-answers.h5")
    options = f"--set iterations=1000 --labels {labels}"
    scores: dict[str, tuple[str, ...]] = {"accuracy": ("metrics", "iqtt_accuracy")}
    return Study(title, (QUESTIONS,), *files, rows, options, scores, ("chance", "outline"))


BOTH = f"{NO_LOSS} adversarial=1 {RECONSTRUCTION}"
LOSSES = {
    "adversarial": f"{NO_LOSS} adversarial=1",
    "reconstruction": f"{NO_LOSS} {RECONSTRUCTION}",
    "adversarial, reconstruction": BOTH,
}
ALL_LOSSES = {**LOSSES, "these and mutual information": f"{BOTH} mutual_information=1"}
DEPTH = {"`compact`": "", "`compact` and depth supervision": "depth=300"}
WEIGHTS = {str(weight): f"mutual_information={weight}" for weight in INFORMATION}
SMALL = "--set networks.size=64 --set networks.width=0.125 --set learning_rate=0.0002"
OBJECTIVE = {
    "the paper's objective": "",
    "one step of the critic": "critic_steps=1",
    "no reconstruction of codes": "code_reconstruction=0",
    "no reconstruction": "reconstruction=0 code_reconstruction=0",
    "no critic": "adversarial=0",
}
STUDIES = {
    "losses": _of_rooms("What each loss brings to rooms (the paper's Table 4)", LOSSES),
    "losses-questions": _of_questions(
        "What each loss brings to questions of the kind `other`, 200 labels",
        ALL_LOSSES,
        200,
    ),
    "objective": _of_rooms(
        "Which parts of the paper's objective matter, at the paper's schedule",
        OBJECTIVE,
        SHAPES,
        "study-shapes",
        f"--config paper {SMALL} --set iterations=3000 --workers 0",
    ),
    "depth": _of_rooms("Depth supervision (the paper's appendix)", DEPTH),
    "information-0": _of_questions("Weight of mutual information, no labels", WEIGHTS, 0),
    "information-200": _of_questions("Weight of mutual information, 200 labels", WEIGHTS, 200),
}


def run(folder: Path, names: Sequence[str], seeds: int) -> list[str]:
    """Train and score all rows of some studies, or of all, with seeds 0, 1, ...; return failures.

    What is there already is not made again.
    """
    chosen = [STUDIES[name] for name in names or STUDIES]
    steps = {step.makes: step for study in chosen for step in study.data}
    failed = each((name, partial(made, folder, step)) for name, step in steps.items())
    if failed:
        return failed
    return each(
        (f"{name}, {row}, seed {seed}", partial(_cell, folder, name, row, seed))
        for name in names or STUDIES
        for row in (*STUDIES[name].floors, *STUDIES[name].rows)
        for seed in range(1 if row in STUDIES[name].floors else seeds)
    )


def _cell(folder: Path, name: str, row: str, seed: int) -> dict[str, Any]:
    """Return the columns of one training run."""
    study, run = STUDIES[name], _run(name, row, seed)
    weights, out, result = (f"{run}/{end}" for end in ("weights.safetensors", "out.h5", "s.json"))
    reads = (study.test,) if row in study.floors else (weights, study.test)
    train, predict, score = commands = commands_of(name, row, seed)
    files = {path: mark(folder / path) for path in (study.train, study.test, study.truth)}

    def scored() -> dict[str, Any]:
        if train:
            made(folder, Step(train, weights, (study.train,), run=run))
        made(folder, Step(predict, out, reads))
        made(folder, Step(score, result, (out, study.truth)))
        scores = json.loads((folder / result).read_text())
        return {column: _found(scores, place) for column, place in study.scores.items()}

    settings = {"commands": commands, "files": files}
    return record(_place(folder, name, row, seed), settings, scored)


def commands_of(name: str, row: str, seed: int) -> list[str]:
    """Return what trains one run, predicts and scores; a floor is not trained: "" in its place."""
    study, run = STUDIES[name], _run(name, row, seed)
    changed = " ".join(f"--set {setting}" for setting in study.rows.get(row, "").split())
    train = f"pix2shape train --data {study.train} {study.options} {changed} --set seed={seed}"
    train = " ".join(f"{train} --out {run}".split())
    weights, out = f"{run}/weights.safetensors", f"{run}/out.h5"
    predict = f"pix2shape predict --weights {weights} --data {study.test} --out {out}"
    if row in study.floors:
        train, predict = "", f"bench baseline {row} --data {study.test} --out {out}"
    return [train, predict, f"bench score {out} --truth {study.truth} --json {run}/s.json"]


def _found(scores: dict[str, Any], place: tuple[str, ...]) -> float | None:
    for key in place:
        scores = scores.get(key, {})
    return scores.get("value")


def _run(name: str, row: str, seed: int) -> str:
    words = "".join(letter if letter.isalnum() else " " for letter in row).split()
    return f"study-{name}/{'-'.join(words) or 'row'}-{seed}"


def _place(folder: Path, name: str, row: str, seed: int) -> Path:
    return folder / "scores" / f"{_run(name, row, seed).replace('/', '-')}.json"


def page(folder: Path) -> str:
    """Return the tables of all studies, as far as they are scored: a mean and a spread a cell."""
    return "\n\n".join(text for name in STUDIES if (text := _section(folder, name)))


def _section(folder: Path, name: str) -> str:
    study, rows = STUDIES[name], []
    views = dict.fromkeys(column.partition(", ")[2] for column in study.scores)
    names = list(dict.fromkeys(column.partition(", ")[0] for column in study.scores))
    found = {row: _runs(folder, name, row) for row in (*study.floors, *study.rows)}
    for view in views:
        for row, runs in found.items():
            columns = [f"{score}, {view}" if view else score for score in names]
            cells = (_mean([run[c] for run in runs], 4 if view else 3) for c in columns)
            start = [view] if view else []
            rows += [[*start, row, str(len(runs)), *cells]] if runs else []
    if not any(found[row] for row in study.rows):
        return ""
    start = ["view"] if any(views) else []
    head = [*start, "setting", "runs", *names]
    return f"### {study.title}\n\n{table(head, rows, len(start) + 1)}"


def _runs(folder: Path, name: str, row: str) -> list[dict[str, Any]]:
    """Return the columns of all runs of a row that are scored, of today's commands alone."""
    first = _place(folder, name, row, 0).stem.removesuffix("0")
    found = []
    for path in sorted((folder / "scores").glob(f"{first}[0-9]*.json")):
        stored, seed = json.loads(path.read_text()), int(path.stem.removeprefix(first))
        if stored["settings"]["commands"] == commands_of(name, row, seed):
            found.append(stored["scores"])
    return found


def _mean(values: list[float | None], digits: int) -> str:
    """Return the mean of runs, and after ± their standard deviation if there are several."""
    known = [value for value in values if value is not None]
    if len(known) < len(values) or not known:
        return NOTHING
    spread = f" ± {statistics.stdev(known):.{digits}f}" if len(known) > 1 else ""
    return f"{statistics.mean(known):.{digits}f}{spread}"
