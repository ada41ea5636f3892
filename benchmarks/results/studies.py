"""The paper's ablations: what each loss brings, depth supervision, and the weight of information.

A study compares settings of the reference model, each trained with several seeds from the same
file, and scored on the same test file. Its table shows means over seeds, and their spread.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.markdown import table
from benchmarks.results.rooms import ANGLES, AT_ANGLES
from benchmarks.results.rows import Row, cells, scores, steps
from benchmarks.results.steps import Step

HOUSEHOLD = "--preset shapenet --object-split {split} --size 64"
SHAPES = "--preset shapes --size 64"
SIZES = {"train": "--n 8000 --seed 1", "test": "--n 300 --views 0,5,35,55,80 --seed 1000"}
QUESTIONS = "--distractors other --train 12000 --labeled 1000 --val 0 --test 2000"
NO_LOSS = "reconstruction=0 code_reconstruction=0 consistency=0 mutual_information=0 contrast=0"
RECONSTRUCTION = "reconstruction=1 code_reconstruction=1 absolute_differences=false"
BOTH = f"{NO_LOSS} adversarial=1 {RECONSTRUCTION}"
LOSSES = {
    "adversarial": f"{NO_LOSS} adversarial=1",
    "reconstruction": f"{NO_LOSS} {RECONSTRUCTION}",
    "adversarial, reconstruction": BOTH,
}
INFORMATION = {str(weight): f"mutual_information={weight}" for weight in (0.1, 0.4, 0.6, 0.8, 1.0)}
SHORT = "--set iterations=1000"
PAPER = (
    "--config paper --set networks.size=64 --set networks.width=0.125 --set learning_rate=0.0002"
    " --set iterations=3000 --workers 0"
)


@dataclass(frozen=True)
class Study:
    """What is compared.

    Attributes:
        title: above the table.
        settings: the name of each row, and its settings as `--set` takes them.
        rooms: options of `scenegen render` for its files; empty for a study of questions.
        options: of `pix2shape train`, for all rows.
    """

    title: str
    settings: Mapping[str, str]
    rooms: str = ""
    options: str = SHORT

    def files(self) -> tuple[str, str, str]:
        """Return the training file, the test file and the truth."""
        if not self.rooms:
            stem = "study-questions/iqtt"
            return f"{stem}-train.h5", f"{stem}-test.h5", f"{stem}-test-answers.h5"
        stem = "study-shapes" if self.rooms == SHAPES else "study"
        return f"{stem}-train.h5", f"{stem}-test.h5", f"{stem}-test.h5"


STUDIES = {
    "losses": Study("What each loss brings to rooms (the paper's Table 4)", LOSSES, HOUSEHOLD),
    "losses-questions": Study(
        "What each loss brings to questions of the kind `other`, 200 labels",
        {**LOSSES, "these and mutual information": f"{BOTH} mutual_information=1"},
        options=f"{SHORT} --labels 200",
    ),
    "objective": Study(
        "Which parts of the paper's objective matter, at the paper's schedule",
        {
            "the paper's objective": "",
            "one step of the critic": "critic_steps=1",
            "no reconstruction of codes": "code_reconstruction=0",
            "no reconstruction": "reconstruction=0 code_reconstruction=0",
            "no critic": "adversarial=0",
        },
        SHAPES,
        PAPER,
    ),
    "depth": Study(
        "Depth supervision (the paper's appendix)",
        {"`compact`": "", "`compact` and depth supervision": "depth=300"},
        HOUSEHOLD,
    ),
    "information-0": Study(
        "Weight of mutual information, no labels", INFORMATION, options=f"{SHORT} --labels 0"
    ),
    "information-200": Study(
        "Weight of mutual information, 200 labels", INFORMATION, options=f"{SHORT} --labels 200"
    ),
}


def rows(name: str) -> Iterator[tuple[str, Row]]:
    """Yield the first cell and the row of each line of a study's table; floors come first."""
    study = STUDIES[name]
    for floor in ("empty-room",) if study.rooms else ("chance", "outline"):
        predict = f"bench baseline {floor} --data {{test}} --out {{out}}"
        yield floor, Row(f"study-{name}-{floor}", predict, most_seeds=1)
    predict = "pix2shape predict --weights {weights} --data {test} --out {out}"
    for line, settings in study.settings.items():
        changes = " ".join(f"--set {setting}" for setting in settings.split())
        train = f"pix2shape train --data {{data}} --out {{run}} {study.options} {changes}"
        words = "".join(letter if letter.isalnum() else " " for letter in line).split()
        stem = f"study-{name}-{'-'.join(words)}"
        yield line, Row(stem, predict, f"{train} --set seed={{seed}}", study.files()[0])


def plan(names: Sequence[str], seeds: int) -> Iterator[Step]:
    """Yield all steps of the studies of these names, or of all."""
    for name in names or STUDIES:
        study = STUDIES[name]
        train, test, truth = study.files()
        if study.rooms:
            for split, out in (("train", train), ("test", test)):
                options = f"{study.rooms.format(split=split)} {SIZES[split]}"
                yield Step((f"scenegen render {options} --out {out}",), out)
        else:
            folder = train.partition("/")[0]
            yield Step((f"iqtt make-split {QUESTIONS} --out {folder}",), folder)
        for _, row in rows(name):
            yield from steps(row, test, truth, "test", seeds)


def page(folder: Path) -> str:
    """Return the tables of all studies, as far as they are scored: mean and spread a cell."""
    return "\n\n".join(filter(None, (_section(folder, name) for name in STUDIES)))


def _section(folder: Path, name: str) -> str:
    files = {line: scores(folder, row, "test") for line, row in rows(name)}
    scored = {(line, str(len(file.meta.submissions))): file for line, file in files.items() if file}
    if not scored:
        return ""
    if STUDIES[name].rooms:
        head, texts = ["view", "setting", "runs", *AT_ANGLES.values()], 2
        lines = [
            [angle, *start, *cells(file, angle, AT_ANGLES, 4, spread=True)]
            for angle in ANGLES
            for start, file in scored.items()
        ]
    else:
        head, texts = ["setting", "runs", "accuracy"], 1
        lines = [
            [*start, *cells(file, "metrics", ["iqtt_accuracy"], spread=True)]
            for start, file in scored.items()
        ]
    return f"### {STUDIES[name].title}\n\n{table(head, lines, texts)}"
