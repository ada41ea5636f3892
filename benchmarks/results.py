"""The commands behind the tables of docs/results.md and docs/data/rooms.csv.

    python -m benchmarks.results [--help]

`TABLES` lists them. They run in one folder, whose `done.txt` has a line for each that is done.
These are passed over, and a training run that was stopped goes on, so this can be stopped and
started again. Use another folder after a change of the code. The score files are in `scores/`;
`bench leaderboard scores/NAME-*.json` prints them.
"""

import argparse
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

from benchmarks.commands import is_done, product, run

Commands = Iterator[str]
BASELINE = "bench baseline"

# ---- questions: Table 3 of the paper, every method on every kind of question ----

KINDS = ("matched", "mirror-pair", "mirror-pair-2", "other", "near", "mirror")
MIXED, OTHER = "mixed/iqtt-train.h5", "other/iqtt-train.h5"
SPLITS = {
    "mixed": "--distractors mixed --train 12000 --labeled 5000 --val 1000 --test 1000",
    "other": "--distractors other --size 64 --compression none --train 121000 --labeled 1000"
    " --val 2000 --test 0",
    "suite": "--preset suite --train 5000 --labeled 5000 --val 0 --test 2000",
}
# Numbers of labels, training file, command of training, options to start without labels.
TRAINED = {
    "cnn": ((200, 1000), MIXED, "bench train cnn", ""),
    "siamese": ((200, 1000), MIXED, "bench train siamese", ""),
    "ptn": ((0, 200, 1000), MIXED, "bench train ptn", """--set 'networks="{start}"'"""),
    "rezende": ((0, 200, 1000), MIXED, "bench train rezende", """--set 'start="{start}"'"""),
    "pix2shape-compact": ((0, 200, 1000), MIXED, "pix2shape train --set iterations=1500", ""),
    "pix2shape-views": (
        (0, 200, 1000),
        OTHER,
        "pix2shape train --config views --precision bf16",
        "--start {start} --set iterations=1200 --set learning_rate=0.0005",
    ),
}
THREE_ANSWERS = ("outline-trees", "cnn")  # methods that choose among three answers only


def questions(seeds: int) -> Commands:
    """Yield what trains all methods with these many seeds, and scores them on the suite."""
    for folder, options in SPLITS.items():
        yield f"iqtt make-split {options} --out {folder}"
    yield from _answers(
        "chance", [f"{BASELINE} chance --seed {seed}" for seed in range(min(seeds, 3))]
    )
    yield from _answers("outline", [f"{BASELINE} outline"])
    for labels in (200, 1000):
        trees = f"{BASELINE} outline-trees --train {MIXED} --labels {labels}"
        yield from _answers(f"outline-trees-{labels}", [trees])
    for name, (numbers, data, program, begin) in TRAINED.items():
        for labels in numbers:
            predict = []
            for seed in range(seeds):
                run, first = f"runs/{name}-{labels}-{seed}", f"runs/{name}-{numbers[0]}-{seed}"
                more = begin.format(start=f"{first}/weights.safetensors") if run != first else ""
                yield f"{program} --data {data} --labels {labels} --seed {seed} {more} --out {run}"
                predict.append(f"{BASELINE} {name} --weights {run}/weights.safetensors")
            yield from _answers(f"{name}-{labels}", predict)


def _answers(name: str, predict: Sequence[str]) -> Commands:
    for kind in KINDS:
        if not kind.endswith("-2") or not name.startswith(THREE_ANSWERS):
            test = f"suite/{kind}/iqtt-test"
            yield from _scored(
                f"questions-{name}-{kind}", predict, f"{test}.h5", f"{test}-answers.h5"
            )


def _scored(name: str, predict: Sequence[str], test: str, truth: str) -> Commands:
    """Yield what writes submissions to one test file, a run each, and what scores them."""
    submissions = [f"submissions/{name}-{run}.h5" for run in range(len(predict))]
    for command, out in zip(predict, submissions, strict=True):
        yield f"{command} --data {test} --out {out}"
    yield f"bench score {' '.join(submissions)} --truth {truth} --json scores/{name}.json"


# ---- rooms: Tables 1 and 2, all methods on three kinds of rooms, one run each ----

PRESETS = ("shapes-single", "shapes", "shapenet")
ROOMS = {"test": "--n 300 --views 0,5,35,55,80 --seed 1000", "train": "--n 20000 --seed 1"}
METHODS = (
    "oracle", "depth-supervised", "depth-completed", "view-pairs", "pix2shape-rays", "pix2shape",
    "pix2shape-compact", "ptn", "empty-room", "mean-depth", "constant",
)  # fmt: skip
NOT_FOR = {"pix2shape-rays": "shapes-single", "pix2shape": "shapenet"}  # no weights are bundled


def rooms(_seeds: int) -> Commands:
    """Yield what scores the bundled weights and the floors."""
    for preset in PRESETS:
        for split, options in ROOMS.items():
            part = f" --object-split {split}" if preset == "shapenet" else ""
            out = f"{split}-{preset}.h5"
            yield f"scenegen render --preset {preset}{part} --size 64 {options} --out {out}"
        for name in METHODS:
            if NOT_FOR.get(name) != preset:
                means = f" --train train-{preset}.h5" if name in ("mean-depth", "constant") else ""
                test = f"test-{preset}.h5"
                yield from _scored(
                    f"rooms-{preset}-{name}", [f"{BASELINE} {name}{means}"], test, test
                )


# ---- studies: the paper's ablations; settings of the reference model on one training file ----

NO_LOSS = "reconstruction=0 code_reconstruction=0 mutual_information=0 contrast=0"
RECONSTRUCTION = "reconstruction=1 code_reconstruction=1 absolute_differences=false"
LOSSES = {
    "adversarial": f"{NO_LOSS} adversarial=1",
    "reconstruction": f"{NO_LOSS} {RECONSTRUCTION}",
    "both": f"{NO_LOSS} adversarial=1 {RECONSTRUCTION}",
}
INFORMATION = {str(weight): f"mutual_information={weight}" for weight in (0.1, 0.4, 0.6, 0.8, 1.0)}
SHORT = "--set iterations=1000"
PAPER = (
    "--config paper --set networks.size=64 --set networks.width=0.125 --set learning_rate=0.0002"
    " --set iterations=3000 --workers 0"
)
STUDIED = {  # training and test files
    "household": "scenegen render --preset shapenet --object-split {split} --size 64 {options}",
    "shapes": "scenegen render --preset shapes --size 64 {options}",
}
STUDIED_QUESTIONS = "--distractors other --train 12000 --labeled 1000 --val 0 --test 2000"
# The files, options of `pix2shape train` for all rows, and the settings of each row.
STUDIES = {
    "losses": ("household", SHORT, LOSSES),
    "losses-questions": (
        "",
        f"{SHORT} --labels 200",
        {**LOSSES, "both-and-information": f"{LOSSES['both']} mutual_information=1"},
    ),
    "objective": (
        "shapes",
        PAPER,
        {
            "paper": "",
            "one-step-of-the-critic": "critic_steps=1",
            "no-reconstruction-of-codes": "code_reconstruction=0",
            "no-reconstruction": "reconstruction=0 code_reconstruction=0",
            "no-critic": "adversarial=0",
        },
    ),
    "depth": ("household", SHORT, {"compact": "", "compact-and-depth": "depth=300"}),
    "information-0": ("", f"{SHORT} --labels 0", INFORMATION),
    "information-200": ("", f"{SHORT} --labels 200", INFORMATION),
}


def studies(seeds: int) -> Commands:
    """Yield what trains and scores each setting of each study, with these many seeds."""
    sizes = {"train": "--n 8000 --seed 1", "test": ROOMS["test"]}
    for name, command in STUDIED.items():
        for split, size in sizes.items():
            yield f"{command.format(split=split, options=size)} --out study-{name}-{split}.h5"
    yield f"iqtt make-split {STUDIED_QUESTIONS} --out study-questions"
    for study, (files, options, settings) in STUDIES.items():
        stem = f"study-{files}-" if files else "study-questions/iqtt-"
        test, truth = f"{stem}test.h5", f"{stem}test.h5" if files else f"{stem}test-answers.h5"
        for floor in ("empty-room",) if files else ("chance", "outline"):
            yield from _scored(f"studies-{study}-{floor}", [f"{BASELINE} {floor}"], test, truth)
        for line, changes in settings.items():
            predict = []
            for seed in range(seeds):
                run = f"runs/studies-{study}-{line}-{seed}"
                changed = " ".join(f"--set {one}" for one in (*changes.split(), f"seed={seed}"))
                yield f"pix2shape train --data {stem}train.h5 {options} {changed} --out {run}"
                predict.append(f"pix2shape predict --weights {run}/weights.safetensors")
            yield from _scored(f"studies-{study}-{line}", predict, test, truth)


# What is made, and where docs/ shows it.
TABLES = {
    "questions": questions,  # results.md, "Questions"
    "rooms": rooms,  # results.md, "Rooms", and data/rooms.csv
    "studies": studies,  # results.md, "Ablations"
}


def main() -> None:
    """Read the options and run; exit with 1 where something failed."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.results", description=__doc__)
    parser.add_argument("--folder", type=Path, default=Path("results"), help="of all products")
    parser.add_argument("--only", choices=TABLES, help="one table")
    parser.add_argument("--with", dest="word", default="", help="commands that have this word")
    parser.add_argument("--seeds", type=int, default=3, help="training runs of each method  [3]")
    parser.add_argument("--print", action="store_true", help="print the commands; run nothing")
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    failed = []
    for name, commands in TABLES.items():
        for command in commands(options.seeds) if options.only in (None, name) else ():
            if options.word in command:
                if options.print:
                    print(command)
                elif not is_done(options.folder, command) and not run(options.folder, command):
                    failed.append(product(command))
    if failed:
        sys.exit(f"{len(failed)} failed: {', '.join(failed)}")


if __name__ == "__main__":
    main()
