"""The report's page: a table for every chart, nothing loaded, nothing wrong for axe-core."""

import pytest
from pages import Page

from iqtt.quiz.answers import read_answers
from metrics.views.people.figures import compute
from metrics.views.people.report import html_report


@pytest.fixture(scope="module")
def page(answers_db, tmp_path_factory):
    path = tmp_path_factory.mktemp("page") / "people.html"
    path.write_text(html_report(compute(read_answers(answers_db))))
    return path


def test_the_figures_are_in_the_tables(page, answers_db):
    figures = compute(read_answers(answers_db))
    found = Page(page.read_text())
    assert found.addresses == ["data:,"], "the icon, so that none is asked for"
    rows = {row[0]: row for row in found.rows}
    for group in (*figures.by_kind, *figures.by_angle):
        assert rows[group.name][1:3] == [str(group.answers), f"{100 * group.accuracy.value:.1f}"]
    assert rows["4"][1] == str(figures.histogram[4])


@pytest.mark.parametrize(("width", "scheme"), [(360, "light"), (1280, "dark")])
def test_in_a_browser(page, visit, width, scheme):
    seen = visit(page.as_uri(), width=width, color_scheme=scheme)
    assert seen.violations() == []
    assert seen.page.evaluate("document.documentElement.scrollWidth") <= width
    charts = seen.page.locator("svg[role=img]")
    assert charts.count() == 4
    for chart in charts.all():
        table = chart.locator("xpath=../following::table[1]")
        assert table.is_visible(), "the numbers of a chart stand below it"
