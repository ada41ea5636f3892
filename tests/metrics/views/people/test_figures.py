"""All figures of the report, computed again from the CSV file with the standard library."""

import csv
import io
import json
import math
import statistics
from collections import defaultdict

import pytest
from quizzes import MADE, made_answers
from refusals import refused
from scipy import stats

from iqtt.floors import Floor
from iqtt.quiz.answers import read_answers, to_csv
from metrics.prediction_writer import write_answers
from metrics.views.people.figures import compute
from metrics.views.people.references import compare, references
from scenegen.common.errors import FileFormatError, SpecError

FLOORS = {"mirror": Floor("mirror", "trees", 0.4, 100), "near": Floor("near", "trees", 0.6, 100)}


@pytest.fixture(scope="module")
def figures(answers_db):
    return compute(read_answers(answers_db), floors=FLOORS)


@pytest.fixture(scope="module")
def lines(answers_db):
    """Return the lines of the CSV file that count."""
    rows = csv.DictReader(io.StringIO(to_csv(read_answers(answers_db))))
    return [line for line in rows if line["finished"] == "1" and line["calibration"] == "0"]


def by_person(lines, value):
    people = defaultdict(list)
    for line in lines:
        people[line["participant"]].append(value(line))
    return {name: statistics.mean(values) for name, values in people.items()}


def student(values):
    half = stats.t.ppf(0.975, len(values) - 1) * statistics.stdev(values) / math.sqrt(len(values))
    return statistics.mean(values) - half, statistics.mean(values) + half


def test_accuracy_histogram_and_counts(figures, lines):
    shares = list(by_person(lines, lambda line: int(line["correct"])).values())
    assert (figures.begun, figures.finished, len(lines)) == (13, 12, 72)
    assert figures.accuracy.value == pytest.approx(statistics.mean(shares))
    assert (figures.accuracy.low, figures.accuracy.high) == pytest.approx(student(shares))
    assert figures.deviation == pytest.approx(statistics.stdev(shares))
    assert list(figures.histogram) == [shares.count(k / 6) for k in range(7)]
    assert list(figures.scores) == [round(6 * share) for share in shares]


def test_tests(figures, lines):
    shares = list(by_person(lines, lambda line: int(line["correct"])).values())
    (chance,) = figures.tests
    t = (statistics.mean(shares) - 1 / 3) / (statistics.stdev(shares) / math.sqrt(12))
    assert (chance.t, chance.degrees) == (pytest.approx(t), 11)
    assert chance.p == pytest.approx(2 * stats.t.sf(abs(t), 11))
    assert figures.shapiro == pytest.approx(tuple(stats.shapiro(shares)))


def test_groups(figures, lines):
    assert [group.name for group in figures.by_kind] == ["mirror", "near"]
    spans = {"30-60": (30, 60), "60-90": (60, 90), "90-120": (90, 120)}
    for group in (*figures.by_kind, *figures.by_angle):
        low, high = spans.get(group.name, (0, 0))
        chosen = [
            line
            for line in lines
            if line["kind"] == group.name or low <= float(line["angle_degrees"]) < high
        ]
        assert group.answers == len(chosen)
        shares = by_person(chosen, lambda line: int(line["correct"]))
        assert group.accuracy.value == pytest.approx(statistics.mean(shares.values()))
        right = [line for line in chosen if line["correct"] == "1"]
        seconds = list(by_person(right, lambda line: float(line["response_seconds"])).values())
        assert (group.seconds is None) == (not seconds)
        if len(seconds) < 2:
            continue
        assert group.seconds.value == pytest.approx(statistics.mean(seconds))
        assert (group.seconds.low, group.seconds.high) == pytest.approx(student(seconds))
    assert figures.by_kind[0].floor == 0.4
    assert sum(group.answers for group in figures.by_angle) == len(lines)


def test_the_line_of_shepard_and_metzler(figures, lines):
    right = [line for line in lines if line["correct"] == "1"]
    angle = by_person(right, lambda line: float(line["angle_degrees"]))
    second = by_person(right, lambda line: float(line["response_seconds"]))
    pairs = [
        (float(line["angle_degrees"]) - angle[line["participant"]],
         float(line["response_seconds"]) - second[line["participant"]])
        for line in right
    ]  # fmt: skip
    slope = sum(x * y for x, y in pairs) / sum(x * x for x, _ in pairs)
    assert figures.line.slope.value == pytest.approx(slope)
    assert figures.line.slope.low < 0.02 < figures.line.slope.high, "the slope of the made-up times"
    assert figures.line.answers == len(right)


def test_times_after_a_reload_do_not_count(tmp_path):
    import sqlite3
    from contextlib import closing

    path = made_answers(tmp_path / "answers.db", participants=3)
    with closing(sqlite3.connect(path)) as db, db:
        db.execute("UPDATE question SET times_shown = 2 WHERE participant < 2")
    assert compute(read_answers(path)).timed == 6


def test_a_model_on_the_same_questions(answers_db, lines, tmp_path, monkeypatch):
    truth = {int(line["question"]): int(line["right_answer"]) for line in lines}
    given = {row: right if row % 3 else (right + 1) % 3 for row, right in truth.items()}
    content = {"method": "mine", "answers": given}
    (tmp_path / "model.json").write_text(json.dumps(content))
    test = compute(read_answers(answers_db), tmp_path / "model.json").tests[1]
    differences = by_person(
        lines,
        lambda line: (
            int(line["correct"]) - (given[int(line["question"])] == int(line["right_answer"]))
        ),
    )
    expected = stats.ttest_1samp(list(differences.values()), 0)
    assert (test.against, test.t, test.p) == (
        "mine",
        pytest.approx(expected.statistic),
        pytest.approx(expected.pvalue),
    )
    del given[min(given)]
    (tmp_path / "model.json").write_text(json.dumps(given))
    with refused(SpecError, found="no answer to 1 questions"):
        compute(read_answers(answers_db), tmp_path / "model.json")


def test_a_model_of_another_split(answers_db, quiz_split, tmp_path):
    write_answers(tmp_path / "m.h5", quiz_split / "iqtt-test.h5", method="m", answer=[0] * 24)
    with pytest.raises(SpecError) as error:
        compute(read_answers(answers_db), tmp_path / "m.h5")
    assert error.value.expected.startswith(MADE.fingerprint[:12])


@pytest.mark.parametrize(("people", "skill"), [(1, 1.0), (2, 1.0), (3, 0.0)])
def test_few_people_and_people_who_do_not_differ(tmp_path, people, skill):
    figures = compute(read_answers(made_answers(tmp_path / "a.db", people, 0, skill)))
    assert (figures.shapiro, figures.tests[0].p) == (None, None)
    assert figures.accuracy.value == skill


def test_nobody_finished(tmp_path):
    with refused(FileFormatError, found="2 participants"):
        compute(read_answers(made_answers(tmp_path / "a.db", 0, 2)))


def test_references():
    kinds = ["mirror", "near", "near", "near"]
    values = {other.name: other.value for other in references(kinds, 3, FLOORS)}
    assert values["Without 3D"] == pytest.approx(0.25 * 0.4 + 0.75 * 0.6)
    assert values["People in the paper"] == 0.7329
    assert (values["Pix2Shape, no labels"], values["Pix2Shape, 1,000 labels"]) == (0.5519, 0.7012)
    assert [other.name for other in references(["mirror-pair-2"], 2, FLOORS)] == ["Chance"]
    from iqtt.quiz.study import Question

    asked = Question(False, 0, "near", 50.0, 0, "")
    own, *_ = compare(3, FLOORS, [(asked, True)] * 14 + [(asked, False)] * 6)
    expected = stats.binomtest(14, 20).proportion_ci(method="wilson")
    assert (own.value, own.low, own.high) == pytest.approx((0.7, expected.low, expected.high))
