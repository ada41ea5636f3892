"""The paper's ablations: which parts of its objective matter.

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

SHAPES = "--preset shapes --size 64"
SIZES = {"train": "--n 8000 --seed 1", "test": "--n 300 --views 0,5,35,55,80 --seed 1000"}
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
        rooms: options of `scenegen render` for its files.
        options: of `pix2shape train`, for all rows.
    """

    title: str
    settings: Mapping[str, str]
    rooms: str
    options: str


TRAIN, TEST = "study-shapes-train.h5", "study-shapes-test.h5"


STUDIES = {
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
}


def rows(name: str) -> Iterator[tuple[str, Row]]:
    """Yield the first cell and the row of each line of a study's table; the floor comes first."""
    study = STUDIES[name]
    predict = "bench baseline empty-room --data {test} --out {out}"
    yield "empty-room", Row(f"study-{name}-empty-room", predict, most_seeds=1)
    predict = "pix2shape predict --weights {weights} --data {test} --out {out}"
    for line, settings in study.settings.items():
        changes = " ".join(f"--set {setting}" for setting in settings.split())
        train = f"pix2shape train --data {{data}} --out {{run}} {study.options} {changes}"
        words = "".join(letter if letter.isalnum() else " " for letter in line).split()
        stem = f"study-{name}-{'-'.join(words)}"
        yield line, Row(stem, predict, f"{train} --set seed={{seed}}", TRAIN)


def plan(names: Sequence[str], seeds: int) -> Iterator[Step]:
    """Yield all steps of the studies of these names, or of all."""
    for name in names or STUDIES:
        for split, out in (("train", TRAIN), ("test", TEST)):
            options = f"{STUDIES[name].rooms} {SIZES[split]}"
            yield Step((f"scenegen render {options} --out {out}",), out)
        for _, row in rows(name):
            yield from steps(row, TEST, TEST, "test", seeds)


def page(folder: Path) -> str:
    """Return the tables of all studies, as far as they are scored: mean and spread a cell."""
    return "\n\n".join(filter(None, (_section(folder, name) for name in STUDIES)))


def _section(folder: Path, name: str) -> str:
    files = {line: scores(folder, row, "test") for line, row in rows(name)}
    scored = {(line, str(len(file.meta.submissions))): file for line, file in files.items() if file}
    if not scored:
        return ""
    head = ["view", "setting", "runs", *AT_ANGLES.values()]
    lines = [
        [angle, *start, *cells(file, angle, AT_ANGLES, 4, spread=True)]
        for angle in ANGLES
        for start, file in scored.items()
    ]
    return f"### {STUDIES[name].title}\n\n{table(head, lines, 2)}"
