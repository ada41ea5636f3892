"""The commands behind the tables of docs/results.md and of docs/data.

    python -m benchmarks.results [--help]

`TABLES` lists the tables. All commands run in one folder, whose `done.txt` names each finished one.
Finished commands are skipped and an interrupted training resumes, so the same call continues. Use
another folder after a change of the code. Score files are in `scores/`;
`bench leaderboard scores/NAME-*.json` prints them.
"""

import argparse
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

from benchmarks.commands import is_done, product, run

Commands = Iterator[str]
BASELINE = "bench baseline"

# ---- questions: Table 3 of the paper, every method on every distractor type ----

BUNDLED = ("siamese", "ptn", "pix2shape-views", "depth-match")  # with weights in the package
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
    "pix2shape-views": (
        (0, 200, 1000),
        OTHER,
        "pix2shape train --config views --precision bf16",
        "--start {start} --set iterations=1200 --set learning_rate=0.0005",
    ),
}
THREE_OPTIONS = ("outline-trees", "cnn")  # methods that choose among three options only


def rotation(_seeds: int) -> Commands:
    """Yield what scores methods without training, and bundled weights, on rotation-1."""
    yield "bench sets make rotation-1 --out sets"
    for name in ("chance", "outline", "cubes", *BUNDLED):
        yield from _answers(name, [f"{BASELINE} {name}"], "sets")


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


def _answers(name: str, predict: Sequence[str], folder: str = "suite") -> Commands:
    table = "questions" if folder == "suite" else "rotation"
    for kind in KINDS:
        if not kind.endswith("-2") or not name.startswith(THREE_OPTIONS):
            test = f"{folder}/{kind}/iqtt-test"
            yield from _scored(
                f"{table}-{name}-{kind}", predict, f"{test}.h5", f"{test}-answers.h5"
            )


def _scored(name: str, predict: Sequence[str], test: str, truth: str) -> Commands:
    """Yield what writes submissions to one test file, a run each, and what scores them."""
    submissions = [f"submissions/{name}-{run}.h5" for run in range(len(predict))]
    for command, out in zip(predict, submissions, strict=True):
        yield f"{command} --data {test} --out {out}"
    yield f"bench score {' '.join(submissions)} --truth {truth} --json scores/{name}.json"


# ---- rooms: all methods on three named test sets, one run each ----

FIVE_VIEWS = "--n 300 --views 0,5,35,55,80 --size 64"
LEARNED = ("depth-supervised", "view-pairs", "balls", "ptn", "pix2shape-rays", "depth-completed")
WITH_DEPTH = ("outline-regression", "outline-relief", "nearest", "mean-depth")  # of --train
SETS = {  # methods, options of the rooms that WITH_DEPTH learn from
    "rooms-1": ((*LEARNED, "cut-out", "picture-outline", "empty-room", *WITH_DEPTH), ""),
    "rooms-shadows-1": (
        (*LEARNED, "cut-out", "picture-outline", "outline-regression"),
        "--shadows",
    ),
    "objects-1": (LEARNED, ""),
    "interiors-512-1": (("depth-supervised", "cut-out", "empty-room"), ""),
}


def rooms(_seeds: int) -> Commands:
    """Yield what scores the bundled weights and the baselines."""
    for name, (methods, options) in SETS.items():
        yield f"bench sets make {name} --out sets"
        if set(methods) & set(WITH_DEPTH):
            yield f"scenegen render {FIVE_VIEWS} --seed 7 {options} --out train-{name}.h5"
        for method in methods:
            learn = f" --train train-{name}.h5" if method in WITH_DEPTH else ""
            test = f"sets/{name}.h5"
            yield from _scored(f"{name}-{method}", [f"{BASELINE} {method}{learn}"], test, test)


# ---- studies: parts of the paper's objective ----

OBJECTIVE = {
    "paper": "",
    "one-step-of-the-critic": "critic_steps=1",
    "no-reconstruction-of-codes": "code_reconstruction=0",
    "no-reconstruction": "reconstruction=0 code_reconstruction=0",
    "no-critic": "adversarial=0",
}
SHORT = (
    "--config paper --set networks.size=64 --set networks.width=0.125 --set learning_rate=0.0002"
    " --set iterations=3000 --workers 0"
)


def studies(seeds: int) -> Commands:
    """Yield what trains and scores each setting, with these many seeds."""
    test, train = "sets/rooms-1.h5", "study-train.h5"
    yield "bench sets make rooms-1 --out sets"
    yield f"scenegen render --preset shapes --size 64 --n 8000 --seed 1 --out {train}"
    for line, changes in OBJECTIVE.items():
        predict = []
        for seed in range(seeds):
            run = f"runs/studies-{line}-{seed}"
            changed = " ".join(f"--set {change}" for change in (*changes.split(), f"seed={seed}"))
            yield f"pix2shape train --data {train} {SHORT} {changed} --out {run}"
            predict.append(f"pix2shape predict --weights {run}/weights.safetensors")
        yield from _scored(f"studies-{line}", predict, test, test)


# What is made, and where docs/ shows it.
TABLES = {
    "rotation": rotation,  # results.md, "Questions"
    "questions": questions,  # data/questions.csv
    "rooms": rooms,  # results.md, "Rooms", and data/rooms.csv
    "studies": studies,  # data/ablations.csv, study `objective`
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
