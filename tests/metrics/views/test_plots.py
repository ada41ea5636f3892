"""Charts: whole SVG that shows every finite number, with a table of the same numbers."""

import math
import re

import numpy as np
import pytest
from pages import Page

from metrics.report.axes import apart, span, tick_labels, width
from metrics.views.plots import FLOOR, Point, Series, curves, histogram

TEXT = r'<text x="([\d.]+)".*?anchor="(\w+)">([^<]*)<'


@pytest.mark.parametrize("values", [[1.0], [2.0, 2.0], [0.0, 0.0], [1e-9, 1.0, np.nan], [-1, 1e7]])
def test_histograms_of_hard_values_are_whole(values):
    chart = histogram(np.array(values, float), "a<b", "unit")
    Page(chart.svg)
    assert "nan" not in chart.svg
    counted = sum(map(int, re.findall(r"to [^:]+: (\d+)<", chart.svg)))
    assert counted == sum(int(row[1]) for row in chart.rows) == np.isfinite(values).sum()
    assert histogram(np.array([np.nan]), "t", "u") is None


def test_curves_begin_at_zero_and_tell_their_numbers_again():
    own = Series("<mine>", [Point(5, 0.00677, 0.006, 0.007), Point(80, 0.004)], "s0")
    floor = Series("floor", [Point(5, 0.01)], FLOOR)
    chart = curves([own, floor, Series("none", [], "s1")], "Chamfer", "scene unit")
    Page(chart.svg)
    assert chart.svg.count('class="range s0"') == 1
    assert chart.svg.count("<path") == 2
    assert "&lt;mine&gt;" not in chart.svg  # names stand in legend and table alone
    assert [name for _, name in chart.legend] == ["<mine>", "floor"]
    assert chart.rows == [
        ("5", "0.006770 [0.006000, 0.007000]", "0.01000"),
        ("80", "0.004000", "-"),
    ]
    assert curves([Series("none", [], "s0")], "t", "u") is None


@pytest.mark.parametrize(
    ("values", "limits", "ends"),
    [
        ([0.00677, 0.004], (0.0, math.inf), (0.0, 0.008)),
        ([0.97], (0.0, 1.0), (0.0, 1.0)),
        ([-0.2, 0.9], (-1.0, 1.0), (-0.5, 1.0)),
        ([math.nan, 170.0], (0.0, 180.0), (0.0, 180.0)),
        ([], (0.0, math.inf), (0.0, 1.0)),
        ([-3e-9], (-math.inf, math.inf), (-3e-9, 0.0)),
    ],
)
def test_an_axis_holds_its_values_from_zero_within_their_limits(values, limits, ends):
    ticks = span(values, *limits)
    assert (ticks[0], ticks[-1]) == pytest.approx(ends)
    assert ticks == sorted(set(ticks))
    assert len(set(tick_labels(ticks))) == len(ticks)


def test_labels_are_neither_cut_off_nor_on_each_other():
    chart = curves([Series("s", [Point(d, 1e-5 * d) for d in range(81)], "s0")], "t", "u")
    narrow = histogram(np.array([1e-6, 3e-5]), "t", "u")
    for x, anchor, text in re.findall(TEXT, chart.svg + narrow.svg):
        start = float(x) - width([text]) * {"end": 1.0, "middle": 0.5}[anchor]
        assert start >= 0, text
        assert start + width([text]) <= 340, text
    places = [0.0, 5.0, 40.0, 41.0]
    assert apart(places, ["0", "5", "40", "41"]) == [0, 3]
