"""Every figure against the tables as the paper's LaTeX source has them."""

import re

from metrics.leaderboard.paper_tables import TABLES
from metrics.scoring.metric_names import metric

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
SHAPES, SHAPENET, MULTIPLE = "Shape scenes", "ShapeNet scenes", "Multiple-shape scenes"
IQTT = "3D-IQTT"


def cells(source, skipped):
    """The cells of each row after the first ones, as (text, spread)."""
    for line in source.strip().splitlines():
        row = re.sub(r"\\\\.*", "", line).split("&")[skipped:]
        numbers = [re.sub(r"\\textbf\{(.*)\}", r"\1", cell.strip()) for cell in row]
        yield [tuple(re.split(r" \$\\pm\$ |$", text, maxsplit=1)) for text in numbers]


def as_kept(number):
    """The figures of a table by what they are about."""
    (table,) = [t for t in TABLES if t.number == number]
    kept = {
        (f.method, f.data, f.metric, f.view_angle, f.labels): (f.text, f.spread)
        for f in table.figures
    }
    assert len(kept) == len(table.figures)
    assert all(f.table == number for f in table.figures)
    return kept


def matched(rows, keys):
    """Figures by key, holes left out; every row has as many cells as keys."""
    found = {}
    for row, row_keys in zip(rows, keys, strict=True):
        found |= {k: c for k, c in zip(row_keys, row, strict=True) if c[0] != "-"}
    return found


def test_table_1():
    columns = [(m, d) for m in ("Pix2Shape", "PTN") for d in (SHAPES, SHAPENET)]
    names = ("chamfer", "hausdorff", "mse_depth")
    keys = [[(m, d, name, None, None) for m, d in columns] for name in names]
    assert as_kept(1) == matched(cells(TABLE_1, 1), keys)
    assert len(as_kept(1)) == 12


def test_table_2():
    columns = [(data, angle) for data in (SHAPES, MULTIPLE) for angle in (5, 35, 55, 80)]
    rows = [("Pix2Shape", name) for name in ("hausdorff", "chamfer", "mse_depth")]
    rows += [("PTN", name) for name in ("chamfer", "mse_depth")]
    keys = [[(m, d, name, angle, None) for d, angle in columns] for m, name in rows]
    assert as_kept(2) == matched(cells(TABLE_2, 2), keys)
    assert len(as_kept(2)) == 40


def test_table_3():
    methods = ["CNN", "Siamese CNN", "Human Evaluation", "Persp. Transf. Nets", "Rezende et al."]
    keys = [
        [(m, IQTT, "iqtt_accuracy", None, labels) for m in (*methods, "Pix2Shape")]
        for labels in (0, 200, 1000)
    ]
    assert as_kept(3) == matched(cells(TABLE_3, 1), keys)
    assert len(as_kept(3)) == 16
    spreads = [spread for _, spread in as_kept(3).values() if spread]
    assert spreads == ["0.148", "0.013", "0.031", "0.021"]


def test_table_4():
    losses = [
        "adversarial loss",
        "reconstruction loss",
        "adversarial and reconstruction loss",
        "reconstruction and mutual information loss",
        "all three losses",
    ]
    keys = [
        [
            *(
                (f"Pix2Shape, {loss}", SHAPENET, "chamfer", angle, None)
                for angle in (0, 35, 55, 80)
            ),
            *((f"Pix2Shape, {loss}", IQTT, "iqtt_accuracy", None, labels) for labels in (0, 1000)),
        ]
        for loss in losses
    ]
    assert as_kept(4) == matched(cells(TABLE_4, 3), keys)
    assert len(as_kept(4)) == 22


def test_every_table_says_what_it_holds():
    assert [t.number for t in TABLES] == [1, 2, 3, 4]
    for table in TABLES:
        assert table.caption.endswith(".")
        assert table.remark.endswith(".")
        for figure in table.figures:
            assert float(figure.text) > 0.0
            assert metric(figure.metric).name == figure.metric
    # The paper states no unit of length.
    assert [t.unit for t in TABLES[:2]] == ["not stated"] * 2
