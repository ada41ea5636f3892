"""The report on people's answers, computed again from the CSV file with the standard library."""

import csv
import io
import json
import math
import statistics
from collections import defaultdict

import pytest
from quizzes import made_answers
from refusals import refused
from scipy import stats

from iqtt.floors import Floor
from iqtt.quiz.answers import read_answers, to_csv
from iqtt.quiz.study import Settings
from metrics.views.people import compute, text_report, to_json
from scenegen.common.errors import FileFormatError

FLOORS = {"mirror": Floor("mirror", "trees", 0.4, 100), "near": Floor("near", "trees", 0.6, 100)}


def shares_of(lines):
    people = defaultdict(list)
    for line in lines:
        people[line["participant"]].append(int(line["correct"]))
    return [statistics.mean(values) for values in people.values()]


def test_accuracies_and_their_intervals(answers_db):
    people = read_answers(answers_db)
    figures = compute(people, FLOORS)
    rows = csv.DictReader(io.StringIO(to_csv(people)))
    lines = [line for line in rows if line["finished"] == "1" and line["calibration"] == "0"]
    assert (figures.begun, figures.finished, len(lines)) == (13, 12, 72)
    assert [group.name for group in figures.groups] == ["all", "mirror", "near"]
    for group in figures.groups:
        chosen = [line for line in lines if group.name in ("all", line["kind"])]
        shares = shares_of(chosen)
        mean, error = statistics.mean(shares), statistics.stdev(shares) / math.sqrt(len(shares))
        half = stats.t.ppf(0.975, len(shares) - 1) * error
        assert group.answers == len(chosen)
        expected = mean, max(0, mean - half), min(1, mean + half)
        assert (group.accuracy, group.low, group.high) == pytest.approx(expected)
    assert [group.floor for group in figures.groups] == [0.5, 0.4, 0.6]


def test_what_stands_beside_them(answers_db, tmp_path):
    values = {one.name: one.value for one in compute(read_answers(answers_db), FLOORS).references}
    assert values["Without 3D"] == pytest.approx(0.5)
    assert values["Chance"] == 1 / 3
    assert values["People in the paper"] == 0.7329
    assert (values["Pix2Shape, no labels"], values["Pix2Shape, 1,000 labels"]) == (0.5519, 0.7012)
    settings = Settings("a" * 64, "b" * 64, 2, questions=6, calibrations=1)
    two = read_answers(made_answers(tmp_path / "a.db", 1, 0, settings=settings))
    assert [other.name for other in compute(two).references] == ["Chance"]


def test_text_and_json_have_every_figure(answers_db):
    figures = compute(read_answers(answers_db), FLOORS)
    text, content = text_report(figures), json.loads(to_json(figures))
    for group, told in zip(figures.groups, content["groups"], strict=True):
        assert (told["name"], told["accuracy"], told["low"]) == (
            group.name, group.accuracy, group.low
        )  # fmt: skip
        line = next(one for one in text.splitlines() if one.split()[:1] == [group.name])
        for value in (group.accuracy, group.low, group.high, group.floor):
            assert f"{100 * value:.1f}" in line
    assert "73.3" in text
    assert content["format_version"] == "2.0"


@pytest.mark.parametrize(("people", "skill"), [(1, 1.0), (2, 0.5), (3, 0.0)])
def test_few_people_and_people_who_do_not_differ(tmp_path, people, skill):
    figures = compute(read_answers(made_answers(tmp_path / "a.db", people, 0, skill)))
    assert (figures.groups[0].low, figures.groups[0].high) == (None, None)
    assert " - " in text_report(figures)


def test_nobody_finished(tmp_path):
    with refused(FileFormatError, found="2 participants"):
        compute(read_answers(made_answers(tmp_path / "a.db", 0, 2)))
