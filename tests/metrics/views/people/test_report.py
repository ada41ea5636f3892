"""The report as text and as JSON has the figures, and the paper's conflict."""

import json

import pytest
from quizzes import made_answers

from iqtt.quiz.answers import read_answers
from metrics.views.people.figures import compute
from metrics.views.people.report import text_report, to_json


@pytest.fixture(scope="module")
def figures(answers_db):
    return compute(read_answers(answers_db))


def test_tables(figures):
    report = text_report(figures)
    assert "12 participants finished of 13 who began" in report
    for value in (figures.accuracy.value, figures.crossed.low, figures.by_kind[0].accuracy.value):
        assert f"{100 * value:.1f}" in report
    assert f"W = {figures.shapiro[0]:.4f}" in report
    assert f"{1000 * figures.line.slope.value:.1f}" in report
    assert "40 people in its text and 41 participants" in report
    histogram = [line.split() for line in report.splitlines() if line.endswith("#")]
    counts = {int(right): int(count) for right, count, _ in histogram}
    assert counts == {k: n for k, n in enumerate(figures.histogram) if n}


def test_json_has_every_figure(figures):
    found = json.loads(to_json(figures))
    assert found["accuracy"]["value"] == figures.accuracy.value
    assert found["line"]["slope"]["low"] == figures.line.slope.low
    assert found["histogram"] == list(figures.histogram)
    assert sum(found["histogram"]) == found["finished"] == 12


def test_one_participant_without_times(tmp_path):
    import sqlite3
    from contextlib import closing

    path = made_answers(tmp_path / "answers.db", participants=1, unfinished=0)
    with closing(sqlite3.connect(path)) as db, db:
        db.execute("UPDATE answer SET response_ms = NULL")
        db.execute("UPDATE question SET angle_degrees = NULL")
    figures = compute(read_answers(path))
    assert (figures.line, figures.by_angle) == (None, [])
    assert "By angle" not in text_report(figures)
    assert json.loads(to_json(figures))["crossed"]["low"] is None
