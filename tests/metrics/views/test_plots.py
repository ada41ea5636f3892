"""Charts: whole SVG of any number, the same bytes each time, with a table of the same numbers."""

import base64
import os
import subprocess
import sys
from xml.etree import ElementTree

import numpy as np
import pytest
from pages import cells_of

from metrics.views.plots import LINE, Point, Series, curves, histogram, strip
from scenegen.common.text_table import number

MINE = Series("<mine>", [Point(5, 0.00677, 0.006, 0.007), Point(80, 0.004)], "s0")
FLOOR = Series("floor", [Point(5, 0.01)], LINE)


def svg_of(url):
    text = base64.b64decode(url.removeprefix("data:image/svg+xml;base64,")).decode()
    ElementTree.fromstring(text)
    assert "nan" not in text
    return text


HARD = [[1.0], [2.0, 2.0], [0.0, 0.0], [1e-9, 1.0, np.nan], [-1, 1e7], [1e100, -1e100], [1e-300]]


@pytest.mark.parametrize("values", HARD)
def test_histograms_of_hard_values_are_whole(values):
    chart = histogram(np.array(values, float), "a<b", "unit")
    assert f"mean {number(np.nanmean(values))}" in svg_of(chart.picture)
    assert histogram(np.array([np.nan]), "t", "u") is None


def test_curves_tell_their_numbers_again_and_draw_no_names():
    chart = curves([MINE, FLOOR, Series("none", [], "s1")], "Chamfer", "scene unit")
    text = svg_of(chart.picture)
    assert "mine" not in text
    assert "scene unit" in text
    assert list(chart.legend) == [("s0", "<mine>"), (LINE, "floor")]
    assert cells_of(chart.table) == {
        "5": ["0.0068 [0.0060, 0.0070]", "0.01000"],
        "80": ["0.004000", "-"],
    }
    assert curves([Series("none", [], "s0")], "t", "u") is None
    for points in ([Point(5, 1e100, -1e100, 1e100)], [Point(d, -1e-5 * d) for d in range(81)]):
        svg_of(curves([Series("s", points, "s0")], "t", "u").picture)


def test_the_same_numbers_give_the_same_bytes(monkeypatch):
    first = curves([MINE, FLOOR], "t", "u")
    monkeypatch.setitem(
        __import__("matplotlib").rcParams, "axes.linewidth", 9
    )  # as a user may have
    assert curves([MINE, FLOOR], "t", "u") == first


@pytest.mark.parametrize("backend", ["module://matplotlib_inline.backend_inline"])
def test_a_backend_that_an_ide_left_behind_does_not_count(backend):
    code = "from metrics.views import plots; print(plots.strip(plots.Point(0, 1.0), [])[0][:9])"
    result = subprocess.run(
        [sys.executable, "-c", code], env={**os.environ, "MPLBACKEND": backend}, text=True,
        capture_output=True, check=False,
    )  # fmt: skip
    assert (result.returncode, result.stdout.strip()) == (0, "data:imag"), result.stderr


@pytest.mark.parametrize(
    ("point", "marks", "others", "limits", "ends"),
    [
        (Point(0, 0.03, -0.03, 0.1), [("floor", 0.0)], [0.3], (-np.inf, np.inf), "-0.1 to 0.3"),
        (Point(0, 0.97, 0.9, 1.0), [("chance", 1 / 3)], [], (0.0, 1.0), "0 to 1"),
        (Point(0, 170.0), [("s1", 20.0)], [np.nan], (0.0, 180.0), "0 to 180"),
        (Point(0, 0.0), [], [], (0.0, np.inf), None),
        (Point(0, 1e100), [("zero", 0.0)], [], (-np.inf, np.inf), None),
    ],
)
def test_a_strip_holds_its_values_from_zero_within_their_limits(point, marks, others, limits, ends):
    drawing, words = strip(point, marks, others, limits)
    svg_of(drawing)
    assert ends in (None, words)
