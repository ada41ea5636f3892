"""Every figure against the tables as the paper's LaTeX source has them."""

import re

import pytest

from metrics.scoring.metric_names import metric
from metrics.views.paper import TABLES

# Rows of numbers, copied from the authors' source; what stands before the first & is dropped.
TABLE_1 = r"""
      Chamfer distance (CD) &  0.103 & 0.133&0.145&0.181\\
      Hausdorff (HD)      &  0.191 & 0.215&0.229&0.254\\
      MSE-depth        & 0.038 & 0.053&0.056&0.103\\
"""
TABLE_2 = r"""
  &HD & 0.156 & 0.191 & 0.189 & 0.202 & 0.308 & 0.355 & 0.329 & 0.316 \\
  \textbf{Ours}&CD & 0.098 & 0.112 & 0.110 & 0.126 & 0.141 & 0.148 & 0.134 & 0.108 \\
  &MSE   & 0.012 & 0.021 & 0.022 & 0.027 & 0.070 & 0.091 & 0.088 & 0.083 \\
  &CD & 0.143 & 0.189 & 0.219 & 0.202 & 0.174 & 0.293 & 0.334 & 0.387 \\
  \textbf{PTN}&MSE   & 0.066 & 0.112 & 0.142 & 0.157 & 0.083 & 0.1969 & 0.1982 & 0.190 \\
"""
TABLE_3 = r"""
        0               & 0.3385      &   0.3698     &  0.7329 $\pm$ 0.148  &0.5344 & 0.5202 &  \textbf{0.5519 $\pm$ 0.013}\\
        200             & 0.3350      &   0.3610     & -   &0.6011 & 0.6155 &  \textbf{0.6312 $\pm$ 0.031}\\
        1,000           & 0.3392      &   0.3701     & -   &0.6645 & 0.7001 & \textbf{0.7012 $\pm$ 0.021}\\ \bottomrule
"""  # noqa: E501
TABLE_4 = r"""
        \checkmark               &       &   &  1.927 &2.341 & 2.350 & 2.281&0.4024&0.4454 \\
                    & \checkmark      &      & 0.1066 &0.1935 & 0.201&0.1925 &0.3321&0.3789\\
        \checkmark            & \checkmark&  & 0.1120 & 0.1522&0.1483&0.1433 &0.4224&0.4921\\
         & \checkmark   &  \checkmark& - & -&-&-&0.4943&0.6272 \\
        \checkmark & \checkmark   &  \checkmark& - & -&-&-&0.5526&0.7020 \\\bottomrule
"""
TABLE_9 = r"""
  Hausdorff-F & 0.093 & 0.088 & 0.085 & 0.096 & 0.173 & 0.218 & 0.194 & 0.201 \\
  Hausdorff-R & 0.081 & 0.100 & 0.108 & 0.112 & 0.221 & 0.243 & 0.238 & 0.254 \\
  MSE-depth   & 0.004 & 0.004 & 0.005 & 0.007 & 0.009 & 0.008 & 0.008 & 0.009 \\
"""
FIGURE_17 = """
(0.1,0.4075) (0.4, 0.4566) (0.6,0.4853) (0.8,0.5130) (1.0,0.5519)
(0.1,0.4823) (0.4,0.5427) (0.6,0.5854) (0.8,0.6001) (1.0,0.6312)
"""
SHAPES, SHAPENET, MULTIPLE = "Shape scenes", "ShapeNet scenes", "Multiple-shape scenes"
IQTT = "3D-IQTT"
METHODS = ["CNN", "Siamese CNN", "Human Evaluation", "Persp. Transf. Nets", "Rezende et al."]
LOSSES = [
    "adversarial loss",
    "reconstruction loss",
    "adversarial and reconstruction loss",
    "reconstruction and mutual information loss",
    "all three losses",
]
# What each cell of a table is about: method, data, score, view angle, labels; row by row.
KEYS_1 = [
    (method, data, score, None, None)
    for score in ("chamfer", "hausdorff", "mse_depth")
    for method in ("Pix2Shape", "PTN")
    for data in (SHAPES, SHAPENET)
]
KEYS_2 = [
    (method, data, score, angle, None)
    for method, scores in (("Pix2Shape", ("hausdorff", "chamfer")), ("PTN", ("chamfer",)))
    for score in (*scores, "mse_depth")
    for data in (SHAPES, MULTIPLE)
    for angle in (5, 35, 55, 80)
]
KEYS_3 = [
    (method, IQTT, "iqtt_accuracy", None, labels)
    for labels in (0, 200, 1000)
    for method in (*METHODS, "Pix2Shape")
]
KEYS_4 = [
    (f"Pix2Shape, {loss}", *about)
    for loss in LOSSES
    for about in (
        *((SHAPENET, "chamfer", angle, None) for angle in (0, 35, 55, 80)),
        *((IQTT, "iqtt_accuracy", None, labels) for labels in (0, 1000)),
    )
]
KEYS_9 = [
    ("Pix2Shape, depth supervision", data, score, angle, None)
    for score in ("hausdorff_forward", "hausdorff_reverse", "mse_depth")
    for data in (SHAPES, MULTIPLE)
    for angle in (5, 35, 55, 80)
]
TABLE = {table.number: table for table in TABLES}


@pytest.mark.parametrize(
    ("number", "source", "skipped", "keys", "count"),
    [
        (1, TABLE_1, 1, KEYS_1, 12),
        (2, TABLE_2, 2, KEYS_2, 40),
        (3, TABLE_3, 1, KEYS_3, 16),
        (4, TABLE_4, 3, KEYS_4, 22),
        (9, TABLE_9, 1, KEYS_9, 24),
    ],
)
def test_every_figure_is_kept_as_printed(number, source, skipped, keys, count):
    cells = []
    for line in source.strip().splitlines():
        for cell in re.sub(r"\\\\.*", "", line).split("&")[skipped:]:
            printed = re.sub(r"\\textbf\{(.*)\}", r"\1", cell.strip())
            cells.append(tuple(re.split(r" \$\\pm\$ |$", printed, maxsplit=1)))
    expected = {k: cell for k, cell in zip(keys, cells, strict=True) if cell[0] != "-"}
    table = TABLE[number]
    kept = {
        (f.method, f.data, f.metric, f.view_angle, f.labels): (f.text, f.spread)
        for f in table.figures
        if f.table == number and metric(f.metric)
    }
    assert kept == expected
    assert len(table.figures) == len(kept) == count
    assert table.ablation == (number in (4, 9))
    assert (table.unit == "not stated") == (
        number in (1, 2, 9)
    )  # the paper names no unit of length


def test_the_points_on_the_weight_of_mutual_information_are_kept():
    lines = FIGURE_17.strip().splitlines()
    expected = {
        (f"Pix2Shape, mutual information weighted {weight}", labels): text
        for labels, line in zip((0, 200), lines, strict=True)
        for weight, text in re.findall(r"\(([\d.]+), ?([\d.]+)\)", line)
    }
    figure = TABLE[17]
    kept = {(f.method, f.labels): f.text for f in figure.figures if f.metric == "iqtt_accuracy"}
    assert kept == expected
    assert len(figure.figures) == len(kept) == 10
    assert (figure.kind, figure.ablation) == ("Figure", True)
