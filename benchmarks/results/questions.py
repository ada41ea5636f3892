"""Table 3 of the paper: the accuracy of every method on every kind of question.

All methods but one learn from one training split of mixed questions, of which a method may use so
many answers as the column says, and are tested on the kinds of the suite. `pix2shape-views` learns
from more questions, of the kind `other`.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path

from benchmarks.markdown import NOTHING, table
from benchmarks.results.rows import Row, cells, scores, steps
from benchmarks.results.steps import Step
from metrics.views.paper import TABLES

KINDS = ("matched", "mirror-pair", "mirror-pair-2", "other", "near", "mirror")
SPLITS = {
    "mixed": "--distractors mixed --train 12000 --labeled 5000 --val 1000 --test 1000",
    "other": "--distractors other --size 64 --compression none --train 121000 --labeled 1000"
    " --val 2000 --test 0",
    "suite": "--preset suite --train 5000 --labeled 5000 --val 0 --test 2000",
}
MIXED, OTHER = "mixed/iqtt-train.h5", "other/iqtt-train.h5"
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
PAPER = {
    "cnn": "CNN",
    "siamese": "Siamese CNN",
    "ptn": "Persp. Transf. Nets",
    "rezende": "Rezende et al.",
    "people": "Human Evaluation",
}
THREE_ANSWERS = ("outline-trees", "cnn")  # methods that choose among three answers only


def rows() -> Iterator[tuple[str, int, Row]]:
    """Yield the method, the number of labels and the row of each line of the table."""
    answer = " --data {test} --out {out}"
    chance = f"bench baseline chance{answer} --seed {{seed}}"
    yield "chance", 0, Row("chance-0", chance, most_seeds=3)
    yield "outline", 0, Row("outline-0", f"bench baseline outline{answer}", most_seeds=1)
    trees = f"bench baseline outline-trees{answer} --train {{data}} --labels "
    for labels in (200, 1000):
        row = Row(f"outline-trees-{labels}", f"{trees}{labels}", data=MIXED, most_seeds=1)
        yield "outline-trees", labels, row
    for name, (numbers, data, program, begin) in TRAINED.items():
        predict = f"bench baseline {name}{answer} --weights {{weights}}"
        train = f"{program} --data {{data}} --seed {{seed}} --out {{run}} --labels "
        first = None
        for labels in numbers:
            more = f" {begin}" if first and begin else ""
            start = first if more else None
            row = Row(f"{name}-{labels}", predict, f"{train}{labels}{more}", data, start)
            first = first or row
            yield name, labels, row


def plan(names: Sequence[str], seeds: int) -> Iterator[Step]:
    """Yield all steps of the methods of these names, or of all."""
    for folder, options in SPLITS.items():
        yield Step((f"iqtt make-split {options} --out {folder}",), folder)
    for name, _, row in rows():
        for kind in KINDS:
            can = not kind.endswith("-2") or name not in THREE_ANSWERS
            if can and (not names or name in names):
                test = f"suite/{kind}/iqtt-test"
                yield from steps(row, f"{test}.h5", f"{test}-answers.h5", kind, seeds)


def page(folder: Path) -> str:
    """Return Table 3 as far as it is scored, and the skills of the same rows."""
    paper = {(figure.method, figure.labels): figure for figure in TABLES[2].figures}

    def reported(name: str, labels: int) -> str:
        figure = paper.get((PAPER.get(name, ""), labels))
        spread = f" ± {figure.spread}" if figure and figure.spread else ""
        return f"{figure.text}{spread}" if figure else NOTHING

    accuracies, skills = [], []
    for name, labels, row in rows():
        files = [scores(folder, row, kind) for kind in KINDS]
        if any(files):
            for part, lines in (("metrics", accuracies), ("skills", skills)):
                line = [cells(file, part, ["iqtt_accuracy"])[0] for file in files]
                lines.append([f"`{name}`", f"{labels:,}", *line])
            accuracies[-1].append(reported(name, labels))
    accuracies.append(["people", *[NOTHING] * (1 + len(KINDS)), reported("people", 0)])
    head = ["method", "labels", *(f"`{kind}`" for kind in KINDS)]
    meaning = "Skill, (accuracy - floor) / (1 - floor), where the floor is that of the kind:"
    return f"{table([*head, 'paper, Table 3'], accuracies)}\n\n{meaning}\n\n{table(head, skills)}"
