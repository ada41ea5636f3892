"""The scores of the Pix2Shape paper, as printed and measured on the authors' data: `paper.csv`.

They are Tables 1 to 4, the appendix's table with depth supervision (9) and its figure on the weight
of mutual information (17), whose points are those of the LaTeX source. Other tables have no scores.

- Tables 1 and 2: distances on 2.5D surfels, MSE on depth maps. No Hausdorff distance of PTN is
  printed in Table 2. Its text calls the multiple-shape scenes ShapeNet scenes.
- Table 3: chance is 1/3. What ± stands for is not stated. People answered 20 questions each.
- Table 4: the head names both losses L_ALI; the second is the reconstruction loss. All three losses
  give 0.5526 and 0.7020, but 0.5519 and 0.7012 in Table 3.
- Table 9: whence Hausdorff-F and -R go is not stated.

Rajeswar, Mannan, Golemo, Parent-Lévesque, Vazquez, Nowrouzezahrai, Courville: Pix2Shape: Towards
Unsupervised Learning of 3D Scenes from Images using a View-based Representation. IJCV 2020,
https://doi.org/10.1007/s11263-020-01322-1.

The authors' images and questions differ from those of any test set made here, and the paper states
no unit of length, so no score made here ranks with these figures.
"""

import csv
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from metrics.scoring.records import ScoreFile
from metrics.views.table import Cell, Table, make_table

PAPER_KIND = "other"  # kind of the paper's questions
SOURCE = "Pix2Shape (IJCV 2020, doi:10.1007/s11263-020-01322-1)"
REPORTED = "as reported, on the authors' data"
ABLATIONS = (4, 9, 17)  # tables on changes of the paper's model, which stand by themselves


@dataclass(frozen=True)
class Figure:
    """One number of the paper.

    Attributes:
        table: the number of its table, or of its figure.
        method: "Pix2Shape" where the paper has "ours"; else as the paper names the method.
        data: what it was measured on, as the paper names it.
        metric: the name of this score in our benchmark.
        text: as printed, without the part after "±".
        spread: the part after "±" as printed, which the paper does not explain; or empty.
        view_angle: degrees between the input's and the predicted view; None where not told.
        labels: how many labelled questions the method was trained on; None for other tasks.
    """

    table: int
    method: str
    data: str
    metric: str
    text: str
    spread: str = ""
    view_angle: int | None = None
    labels: int | None = None


def _read() -> Iterator[Figure]:
    with Path(__file__).with_suffix(".csv").open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            told: dict[str, Any] = dict(row)
            for name in ("table", "view_angle", "labels"):
                told[name] = int(row[name]) if row[name] else None
            yield Figure(**told)


FIGURES = tuple(_read())


def figures_of(scores: ScoreFile) -> list[Figure]:
    """Return the figures that stand beside scores, without those of ablations.

    There are none beside what is measured in metres, and none beside other kinds of questions.
    """
    kinds = set(scores.by_distractor) if scores.task == "iqtt" else {PAPER_KIND}
    if scores.task == "measured" or scores.length == "metre" or kinds - {PAPER_KIND}:
        return []
    return [f for f in FIGURES if f.table not in ABLATIONS and f.metric in scores.metrics]


def paper_table(figures: Sequence[Figure]) -> Table:
    """Return a row for each method, data and angle of the paper, as printed."""
    names = list(dict.fromkeys(f.metric for f in figures))
    rows: dict[tuple[str, ...], dict[str, Cell]] = {}
    for f in figures:
        angle = "-" if f.view_angle is None else f"{f.view_angle}°"
        labels = "-" if f.labels is None else f"{f.labels:,}"
        about = (f.method, f.data, angle, labels, str(f.table))
        rows.setdefault(about, {})[f.metric] = Cell(f.text, f"± {f.spread}" if f.spread else "")
    head = ("method", "data", "view angle", "labels", "table", *names)
    cells: list[list[Cell | str]] = [
        [*about, *(row.get(name, Cell()) for name in names)] for about, row in rows.items()
    ]
    note = f"{SOURCE}, {REPORTED}, whose unit of length the paper does not state"
    return replace(make_table("as the paper reports", head, cells), notes=(note,))
