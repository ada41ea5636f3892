"""Table 3 of the paper: the accuracy of every method on every kind of question.

All methods but one learn from one training split of mixed questions, of which a method may use so
many answers as the column says, and are tested on the kinds of the suite. `pix2shape-views` learns
from more questions, of the kind `other`.
"""

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from benchmarks.results.markdown import NOTHING, shown, table
from benchmarks.results.steps import Step, bundled_mark, each, made, mark, record
from metrics.report.paper_tables import TABLES

KINDS = ("matched", "mirror-pair", "mirror-pair-2", "other", "near", "mirror")
TRAINING = Step(
    "iqtt make-split --distractors mixed --train 12000 --labeled 5000 --val 1000 --test 1000"
    " --out mixed",
    "mixed",
)
OTHER = Step(
    "iqtt make-split --distractors other --size 64 --compression none --train 121000 --labeled 1000"
    " --val 2000 --test 0 --out other",
    "other",
)
SUITE = Step(
    "iqtt make-split --preset suite --train 5000 --labeled 5000 --val 0 --test 2000 --out suite",
    "suite",
)
TRAIN = "mixed/iqtt-train.h5"
LABELS = (0, 200, 1000)


@dataclass(frozen=True)
class Method:
    """A row of the table for each number of labels.

    Attributes:
        name: as in `bench baseline NAME`.
        labels: numbers of labelled questions.
        answer: the command that writes a submission for {test}, to {out}.
        train: the command that trains in folder {run}; empty where nothing is trained.
        start: what is added to it where labels are used, if all but a last layer is that of the run
            without labels, whose weights are {start}; or empty.
        runs: how many seeds at most; one where the seed changes nothing.
        paper: its name in the paper's Table 3.
        answers: numbers of answers that it can choose from.
        data: the file that it learns from.
    """

    name: str
    labels: tuple[int, ...]
    answer: str
    train: str = ""
    start: str = ""
    runs: int = 10
    paper: str = ""
    answers: tuple[int, ...] = (2, 3)
    data: str = TRAIN


def _trained(name: str, labels: tuple[int, ...], **more: Any) -> Method:
    """Return a method of `bench train` and `bench baseline`."""
    answer = "--data {test} --weights {run}/weights.safetensors --out {out}"
    train = "--data {train} --labels {labels} --seed {seed} --out {run}"
    return Method(
        name, labels, f"bench baseline {name} {answer}", f"bench train {name} {train}", **more
    )


METHODS = (
    Method("chance", (0,), "bench baseline chance --data {test} --seed {seed} --out {out}", runs=3),
    Method("outline", (0,), "bench baseline outline --data {test} --out {out}", runs=1),
    Method(
        "outline-trees",
        (200, 1000),
        "bench baseline outline-trees --train {train} --labels {labels} --data {test} --out {out}",
        runs=1,
    ),
    _trained("cnn", (200, 1000), paper="CNN", answers=(3,)),
    _trained("siamese", (200, 1000), paper="Siamese CNN"),
    _trained("ptn", LABELS, paper="Persp. Transf. Nets", start="""--set 'networks="{start}"'"""),
    _trained("rezende", LABELS, paper="Rezende et al.", start="""--set 'start="{start}"'"""),
    Method(
        "pix2shape-compact",
        LABELS,
        "bench baseline pix2shape-compact --data {test} --weights {run}/weights.safetensors"
        " --out {out}",
        "pix2shape train --data {train} --labels {labels} --seed {seed} --set iterations=1500"
        " --out {run}",
        paper="Pix2Shape",
    ),
    Method(
        "pix2shape-views",
        LABELS,
        "bench baseline pix2shape-views --data {test} --weights {run}/weights.safetensors"
        " --out {out}",
        "pix2shape train --data {train} --labels {labels} --seed {seed} --config views"
        " --precision bf16 --out {run}",
        start="--start {start} --set iterations=1200 --set learning_rate=0.0005",
        data="other/iqtt-train.h5",
    ),
)
PEOPLE = "Human Evaluation"  # of the paper


def run(folder: Path, methods: Sequence[str], seeds: int) -> list[str]:
    """Score all methods that are not scored yet; return what failed."""
    failed = each((step.makes, partial(made, folder, step)) for step in (TRAINING, OTHER, SUITE))
    if failed:
        return failed
    return each(
        (
            f"{method.name}, {labels} labels, {kind}",
            partial(_cell, folder, method, labels, kind, seeds),
        )
        for method in METHODS
        if not methods or method.name in methods
        for labels in method.labels
        for kind in KINDS
        if _answers(kind) in method.answers
    )


def _answers(kind: str) -> int:
    return 2 if kind.endswith("-2") else 3


def _cell(folder: Path, method: Method, labels: int, kind: str, seeds: int) -> dict[str, Any]:
    """Return the scores of a method on a kind of questions, as means over its runs."""
    test = f"suite/{kind}/iqtt-test.h5"
    numbers = range(min(seeds, method.runs))
    settings = {
        "method": method.name,
        "labels": labels,
        "kind": kind,
        "seeds": len(numbers),
        "train": method.train + (f" {method.start}" if labels else ""),
        "answer": method.answer,
        "files": {path: mark(folder / path) for path in (method.data, test)},
        "bundled": "" if method.train else bundled_mark(method.name),
    }

    def score() -> dict[str, Any]:
        outs = []
        for seed in numbers:
            run, out = _run(method, labels, seed), f"{_run(method, labels, seed)}/answers-{kind}.h5"
            reads = [test, *([_weights(folder, method, labels, seed)] if method.train else [])]
            words = {"train": method.data, "labels": labels, "seed": seed, "run": run, "test": test}
            made(folder, Step(method.answer.format(**words, out=out), out, tuple(reads)))
            outs.append(out)
        truth = test.replace(".h5", "-answers.h5")
        result = f"{method.name}-{labels}/{kind}-scores.json"
        command = f"bench score {' '.join(outs)} --truth {truth} --json {result}"
        made(folder, Step(command, result, (*outs, truth)))
        scores = json.loads((folder / result).read_text())
        return {name: scores.get(name, {}) for name in ("metrics", "skills")}

    return record(_place(folder, method.name, labels, kind), settings, score)


def _run(method: Method, labels: int, seed: int) -> str:
    return f"{method.name}-{labels}-{seed}"


def _weights(folder: Path, method: Method, labels: int, seed: int) -> str:
    """Train a method, unless it is trained; return the path of its weights."""
    run, command, reads = _run(method, labels, seed), method.train, [method.data]
    words = {"train": method.data, "labels": labels, "seed": seed, "run": run}
    if labels and method.start:
        words["start"], command = _weights(folder, method, 0, seed), f"{command} {method.start}"
        reads.append(words["start"])
    weights = f"{run}/weights.safetensors"
    made(folder, Step(command.format(**words), weights, tuple(reads), run=run))
    return weights


def _place(folder: Path, method: str, labels: int, kind: str) -> Path:
    return folder / "scores" / f"questions-{method}-{labels}-{kind}.json"


def page(folder: Path) -> str:
    """Return Table 3 as far as it is scored, and the skills of the same rows."""
    figures = {(f.method, f.labels): f for f in TABLES[2].figures}

    def printed(method: str, labels: int) -> str:
        figure = figures.get((method, labels))
        if figure is None:
            return NOTHING
        return figure.text + (f" ± {figure.spread}" if figure.spread else "")

    kinds = [f"`{kind}`" for kind in KINDS]
    rows = [
        [*row, printed(method.paper, labels)] for method, labels, row in _rows(folder, "metrics")
    ]
    rows.append(["people", NOTHING, *[NOTHING] * len(KINDS), printed(PEOPLE, 0)])
    accuracy = table(["method", "labels", *kinds, "paper, Table 3"], rows)
    skills = [row for *_, row in _rows(folder, "skills")]
    if not skills:
        return accuracy
    told = "Skill, (accuracy - floor) / (1 - floor), where the floor is that of the kind:"
    return f"{accuracy}\n\n{told}\n\n{table(['method', 'labels', *kinds], skills)}"


def _rows(folder: Path, what: str) -> Iterator[tuple[Method, int, list[str]]]:
    """Yield the rows that have a figure: method, labels, and the cells."""
    for method in METHODS:
        for labels in method.labels:
            paths = [_place(folder, method.name, labels, kind) for kind in KINDS]
            found = [json.loads(p.read_text())["scores"][what] if p.exists() else {} for p in paths]
            cells = [shown(scores.get("iqtt_accuracy")) for scores in found]
            if any(cell != NOTHING for cell in cells):
                yield method, labels, [f"`{method.name}`", f"{labels:,}", *cells]
