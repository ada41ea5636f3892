"""The report on people's answers as text, as JSON, and as a page with charts."""

import json
import sqlite3
from contextlib import closing

import pytest
from pages import Page
from quizzes import made_answers

from iqtt.quiz.answers import read_answers
from metrics.views.people.figures import compute
from metrics.views.people.report import html_report, text_report, to_json


@pytest.fixture(scope="module")
def figures(answers_db):
    return compute(read_answers(answers_db))


def test_tables_have_the_figures(figures):
    report = text_report(figures)
    assert "12 participants finished of 13 who began" in report
    for value in (figures.accuracy.value, figures.crossed.low, figures.by_kind[0].accuracy.value):
        assert f"{100 * value:.1f}" in report
    assert f"W = {figures.shapiro[0]:.4f}" in report
    assert f"{1000 * figures.line.slope.value:.1f}" in report
    histogram = [line.split() for line in report.splitlines() if line.endswith("#")]
    counts = {int(right): int(count) for right, count, _ in histogram}
    assert counts == {k: n for k, n in enumerate(figures.histogram) if n}


def test_json_has_every_figure(figures):
    content = json.loads(to_json(figures))
    assert content["accuracy"]["value"] == figures.accuracy.value
    assert content["line"]["slope"]["low"] == figures.line.slope.low
    assert content["histogram"] == list(figures.histogram)
    assert sum(content["histogram"]) == content["finished"] == 12


def test_the_page_has_the_figures_and_charts(figures, tmp_path, visit):
    text = html_report(figures)
    page = Page(text)
    charts = [address for address in page.addresses if address.startswith("data:image/svg")]
    assert len(charts) == 3
    assert set(page.addresses) == {"data:,", *charts}
    rows = {row[0]: row for row in page.rows}
    for group in (*figures.by_kind, *figures.by_angle):
        assert rows[group.name][1:3] == [str(group.answers), f"{100 * group.accuracy.value:.1f}"]
    (tmp_path / "people.html").write_text(text)
    seen = visit((tmp_path / "people.html").as_uri(), width=360)
    assert seen.violations() == []
    assert seen.page.evaluate("document.documentElement.scrollWidth") <= 360


def test_one_participant_without_times(tmp_path):
    path = made_answers(tmp_path / "answers.db", participants=1, unfinished=0)
    with closing(sqlite3.connect(path)) as db, db:
        db.execute("UPDATE answer SET response_ms = NULL")
        db.execute("UPDATE question SET angle_degrees = NULL")
    figures = compute(read_answers(path))
    assert (figures.line, figures.by_angle) == (None, [])
    assert "By angle" not in text_report(figures)
    assert "svg" in html_report(figures)
    assert json.loads(to_json(figures))["crossed"]["low"] is None
