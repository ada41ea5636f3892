"""The paper's figures: all of them, each on its place, by rows as its LaTeX source has them."""

from collections import Counter

import pytest

from metrics.scoring.metric_names import metric
from metrics.views.paper import FIGURES

SHAPES, MULTIPLE, IQTT = "Shape scenes", "Multiple-shape scenes", "3D-IQTT"
# A row of each table, or more: method, data, score, labels, and the row as it is printed.
ROWS = [
    (1, "PTN", SHAPES, "hausdorff", None, "0.229"),
    (1, "Pix2Shape", "ShapeNet scenes", "mse_depth", None, "0.053"),
    (2, "Pix2Shape", SHAPES, "hausdorff", None, "0.156 & 0.191 & 0.189 & 0.202"),
    (2, "Pix2Shape", MULTIPLE, "chamfer", None, "0.141 & 0.148 & 0.134 & 0.108"),
    (2, "PTN", MULTIPLE, "mse_depth", None, "0.083 & 0.1969 & 0.1982 & 0.190"),
    (3, "Human Evaluation", IQTT, "iqtt_accuracy", 0, r"0.7329 $\pm$ 0.148"),
    (3, "Pix2Shape", IQTT, "iqtt_accuracy", 1000, r"0.7012 $\pm$ 0.021"),
    (3, "Siamese CNN", IQTT, "iqtt_accuracy", 200, "0.3610"),
    (4, "Pix2Shape, adversarial loss", "ShapeNet scenes", "chamfer", None,
     "1.927 & 2.341 & 2.350 & 2.281"),
    (4, "Pix2Shape, all three losses", IQTT, "iqtt_accuracy", 0, "0.5526"),
    (9, "Pix2Shape, depth supervision", MULTIPLE, "hausdorff_reverse", None,
     "0.221 & 0.243 & 0.238 & 0.254"),
    (17, "Pix2Shape, mutual information weighted 0.6", IQTT, "iqtt_accuracy", 200, "0.5854"),
]  # fmt: skip


@pytest.mark.parametrize(("number", "method", "data", "score", "labels", "printed"), ROWS)
def test_figures_are_as_printed(number, method, data, score, labels, printed):
    about = number, method, data, score, labels
    figures = [f for f in FIGURES if (f.table, f.method, f.data, f.metric, f.labels) == about]
    texts = [f.text + (rf" $\pm$ {f.spread}" if f.spread else "") for f in figures]
    assert " & ".join(texts) == printed
    angles = [f.view_angle for f in figures]
    assert angles == sorted(set(angles)) if len(angles) > 1 else angles == [None]


def test_every_figure_is_there_once():
    assert Counter(f.table for f in set(FIGURES)) == {1: 12, 2: 40, 3: 16, 4: 22, 9: 24, 17: 10}
    assert len(FIGURES) == 124
    assert all(metric(figure.metric) for figure in FIGURES)
