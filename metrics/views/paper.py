"""The scores of the Pix2Shape paper, as printed and measured on the authors' data.

They are Tables 1 to 4, the appendix's table with depth supervision and its figure on the weight of
mutual information, whose points are those of the LaTeX source. Other tables have no scores.

Rajeswar, Mannan, Golemo, Parent-Lévesque, Vazquez, Nowrouzezahrai, Courville: Pix2Shape: Towards
Unsupervised Learning of 3D Scenes from Images using a View-based Representation. IJCV 2020,
https://doi.org/10.1007/s11263-020-01322-1.

The authors' images and questions differ from those of any test set made here, and the paper states
no unit of length, so no score made here ranks with these figures.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

from metrics.scoring.records import ScoreFile
from metrics.views.table import Cell, Table, make_table

PAPER, PEOPLE = "Pix2Shape", "Human Evaluation"  # of the paper's methods
PAPER_KIND = "other"  # kind of the paper's questions
SOURCE = "Pix2Shape (IJCV 2020, doi:10.1007/s11263-020-01322-1)"
REPORTED = "as reported, on the authors' data"
DEPTH_UNIT = "not stated"
SHARE_UNIT = "fraction of questions"


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


@dataclass(frozen=True)
class PaperTable:
    """A table of the paper.

    Attributes:
        caption: its title and first sentence.
        unit: of its figures, as the paper states it.
        remark: what a reader has to know.
        figures: all numbers, row by row.
        kind: "Table", or "Figure" where the numbers are points of a plot. Both are numbered in the
            order of the LaTeX source.
        ablation: whether it is on changes of the paper's model, so that it only stands by itself.
    """

    number: int
    caption: str
    unit: str
    remark: str
    figures: tuple[Figure, ...]
    kind: Literal["Table", "Figure"] = "Table"
    ablation: bool = False


_SHAPES, _SHAPENET, _MULTIPLE = "Shape scenes", "ShapeNet scenes", "Multiple-shape scenes"
_OTHERS = ("CNN", "Siamese CNN", "Human Evaluation", "Persp. Transf. Nets", "Rezende et al.")
_ANGLES = (5, 35, 55, 80)


def _table_1() -> Iterator[Figure]:
    columns = [(method, data) for method in ("Pix2Shape", "PTN") for data in (_SHAPES, _SHAPENET)]
    rows = {
        "chamfer": "0.103 0.133 0.145 0.181",
        "hausdorff": "0.191 0.215 0.229 0.254",
        "mse_depth": "0.038 0.053 0.056 0.103",
    }
    for metric, texts in rows.items():
        for (method, data), text in zip(columns, texts.split(), strict=True):
            yield Figure(1, method, data, metric, text)


def _table_2() -> Iterator[Figure]:
    rows = (
        ("Pix2Shape", "hausdorff", "0.156 0.191 0.189 0.202 0.308 0.355 0.329 0.316"),
        ("Pix2Shape", "chamfer", "0.098 0.112 0.110 0.126 0.141 0.148 0.134 0.108"),
        ("Pix2Shape", "mse_depth", "0.012 0.021 0.022 0.027 0.070 0.091 0.088 0.083"),
        ("PTN", "chamfer", "0.143 0.189 0.219 0.202 0.174 0.293 0.334 0.387"),
        ("PTN", "mse_depth", "0.066 0.112 0.142 0.157 0.083 0.1969 0.1982 0.190"),
    )
    columns = [(data, angle) for data in (_SHAPES, _MULTIPLE) for angle in _ANGLES]
    for method, metric, texts in rows:
        for (data, angle), text in zip(columns, texts.split(), strict=True):
            yield Figure(2, method, data, metric, text, view_angle=angle)


def _table_3() -> Iterator[Figure]:
    rows = {
        0: "0.3385 0.3698 0.7329±0.148 0.5344 0.5202 0.5519±0.013",
        200: "0.3350 0.3610 - 0.6011 0.6155 0.6312±0.031",
        1000: "0.3392 0.3701 - 0.6645 0.7001 0.7012±0.021",
    }
    for labels, texts in rows.items():
        for method, printed in zip((*_OTHERS, "Pix2Shape"), texts.split(), strict=True):
            text, _, spread = printed.partition("±")
            if text != "-":
                yield Figure(3, method, "3D-IQTT", "iqtt_accuracy", text, spread, labels=labels)


def _table_4() -> Iterator[Figure]:
    """Yield the figures of five sets of losses.

    Each set has Chamfer distances at four view angles on ShapeNet scenes, where the mutual
    information loss plays no part, and accuracies without labels and with 1,000.
    """
    rows = (
        ("adversarial loss", "1.927 2.341 2.350 2.281", "0.4024 0.4454"),
        ("reconstruction loss", "0.1066 0.1935 0.201 0.1925", "0.3321 0.3789"),
        ("adversarial and reconstruction loss", "0.1120 0.1522 0.1483 0.1433", "0.4224 0.4921"),
        ("reconstruction and mutual information loss", "", "0.4943 0.6272"),
        ("all three losses", "", "0.5526 0.7020"),
    )
    for losses, chamfers, accuracies in rows:
        method = f"Pix2Shape, {losses}"
        for angle, text in zip((0, *_ANGLES[1:]), chamfers.split(), strict=False):
            yield Figure(4, method, _SHAPENET, "chamfer", text, view_angle=angle)
        for labels, text in zip((0, 1000), accuracies.split(), strict=True):
            yield Figure(4, method, "3D-IQTT", "iqtt_accuracy", text, labels=labels)


def _table_9() -> Iterator[Figure]:
    rows = {
        "hausdorff_forward": "0.093 0.088 0.085 0.096 0.173 0.218 0.194 0.201",
        "hausdorff_reverse": "0.081 0.100 0.108 0.112 0.221 0.243 0.238 0.254",
        "mse_depth": "0.004 0.004 0.005 0.007 0.009 0.008 0.008 0.009",
    }
    columns = [(data, angle) for data in (_SHAPES, _MULTIPLE) for angle in _ANGLES]
    for metric, texts in rows.items():
        for (data, angle), text in zip(columns, texts.split(), strict=True):
            yield Figure(9, "Pix2Shape, depth supervision", data, metric, text, view_angle=angle)


def _figure_17() -> Iterator[Figure]:
    rows = {0: "0.4075 0.4566 0.4853 0.5130 0.5519", 200: "0.4823 0.5427 0.5854 0.6001 0.6312"}
    for labels, texts in rows.items():
        for weight, text in zip(("0.1", "0.4", "0.6", "0.8", "1.0"), texts.split(), strict=True):
            method = f"Pix2Shape, mutual information weighted {weight}"
            yield Figure(17, method, "3D-IQTT", "iqtt_accuracy", text, labels=labels)


TABLES: Sequence[PaperTable] = (
    PaperTable(
        1,
        "Scene reconstruction results. Evaluation of Pix2Shape on scene reconstruction with Chamfer"
        " distance and Hausdorff metric on 2.5D surfels and MSE on the depth maps.",
        DEPTH_UNIT,
        "PTN: Perspective Transformer Nets.",
        tuple(_table_1()),
    ),
    PaperTable(
        2,
        "View point reconstruction. Quantitative evaluation of scene reconstruction for unseen"
        " views by extrapolating the view angle from 0° (original) to 80°.",
        DEPTH_UNIT,
        "PTN: Perspective Transformer Nets, for which no HD is printed. The text calls the"
        " multiple-shape scenes ShapeNet scenes.",
        tuple(_table_2()),
    ),
    PaperTable(
        3,
        "3D-IQTT results. Evaluation on the 3D-IQTT task of our model, two CNN-based baselines,"
        " Perspective Transformer Nets and Rezende et al.",
        SHARE_UNIT,
        "Chance is 1/3. What ± stands for is not stated. People answered 20 questions each.",
        tuple(_table_3()),
    ),
    PaperTable(
        4,
        "Loss analysis. Ablation study of the different losses used to train our model on both"
        " reconstruction task and 3D-IQTT task.",
        f"{DEPTH_UNIT} (Chamfer), {SHARE_UNIT} (3D-IQTT)",
        "The head names both losses L_ALI; the second is the reconstruction loss. All three losses"
        " give 0.5526 and 0.7020 here, 0.5519 and 0.7012 in Table 3.",
        tuple(_table_4()),
        ablation=True,
    ),
    PaperTable(
        9,
        "View point reconstruction. Quantitative evaluation of implicit 3D reconstruction for"
        " unseen views by extrapolating the view angle from 0° (original) to 80° with depth"
        " supervision.",
        DEPTH_UNIT,
        "Which of Hausdorff-F and Hausdorff-R begins at the prediction is not stated.",
        tuple(_table_9()),
        ablation=True,
    ),
    PaperTable(
        17,
        "Study of effect of mutual-information objective on 3D-IQTT performance. Our model"
        " performance is correlated positively to the weight on Mutual information term increases.",
        SHARE_UNIT,
        "The points of its two lines. Those of weight 1.0 are Table 3's.",
        tuple(_figure_17()),
        kind="Figure",
        ablation=True,
    ),
)


def figures_of(scores: ScoreFile) -> list[Figure]:
    """Return the figures that stand beside scores, without those of ablations.

    There are none beside what is measured in metres, and none beside other kinds of questions.
    """
    kinds = set(scores.by_distractor) if scores.task == "iqtt" else {PAPER_KIND}
    if scores.task == "measured" or scores.length == "metre" or kinds - {PAPER_KIND}:
        return []
    figures = [f for table in TABLES if not table.ablation for f in table.figures]
    return [f for f in figures if f.metric in scores.metrics]


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
