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


_SHAPES, _SHAPENET, _MULTIPLE = "Shape scenes", "ShapeNet scenes", "Multiple-shape scenes"
_OTHERS = ("CNN", "Siamese CNN", "Human Evaluation", "Persp. Transf. Nets", "Rezende et al.")
_ANGLES = (5, 35, 55, 80)


def _table_1() -> Iterator[Figure]:
    """Yield scene reconstruction: distances on 2.5D surfels, MSE on depth maps."""
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
    """Yield scene reconstruction for unseen views, by their angle from the original one.

    No Hausdorff distance of PTN is printed. The text calls the multiple-shape scenes ShapeNet
    scenes.
    """
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
    """Yield 3D-IQTT. Chance is 1/3. What ± stands for is not stated. People answered 20 each."""
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
    information loss plays no part, and accuracies without labels and with 1,000. The head names
    both losses L_ALI; the second is the reconstruction loss. All three give 0.5526 and 0.7020 here,
    0.5519 and 0.7012 in Table 3.
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
    """Yield unseen views with depth supervision; whence Hausdorff-F and -R go is not stated."""
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
    """Yield the two lines on the weight of mutual information; that of 1.0 is Table 3's."""
    rows = {0: "0.4075 0.4566 0.4853 0.5130 0.5519", 200: "0.4823 0.5427 0.5854 0.6001 0.6312"}
    for labels, texts in rows.items():
        for weight, text in zip(("0.1", "0.4", "0.6", "0.8", "1.0"), texts.split(), strict=True):
            method = f"Pix2Shape, mutual information weighted {weight}"
            yield Figure(17, method, "3D-IQTT", "iqtt_accuracy", text, labels=labels)


FIGURES: tuple[Figure, ...] = (
    *_table_1(), *_table_2(), *_table_3(), *_table_4(), *_table_9(), *_figure_17(),
)  # fmt: skip


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
