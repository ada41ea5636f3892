"""The CSV file: a line for each answer, with the values of the database."""

import csv
import io
import sqlite3
from contextlib import closing

from quizzes import made_answers

from iqtt.quiz.answers import Answer, read_answers, to_csv


def test_every_answer_is_a_line(tmp_path):
    path = made_answers(tmp_path / "answers.db", participants=3)
    lines = list(csv.DictReader(io.StringIO(to_csv(read_answers(path)))))
    assert list(lines[0]) == list(Answer.__dataclass_fields__)
    with closing(sqlite3.connect(path)) as db:
        stored = db.execute(
            "SELECT p.name, position, row, place, answer, response_ms, kind, calibration, sequence"
            " FROM answer JOIN question USING (participant, position)"
            " JOIN participant p ON p.number = participant ORDER BY participant, position"
        ).fetchall()
    assert len(lines) == len(stored) == 3 * 7 + 3
    for line, row in zip(lines, stored, strict=True):
        name, position, question, right, answer, ms, kind, calibration, order = row
        assert line["participant"] == name
        told = [line[n] for n in ("position", "question", "right_answer", "answer", "order")]
        assert list(map(int, told)) == [position, question, right, answer, order]
        assert float(line["response_seconds"]) == ms / 1000
        assert (line["kind"], line["calibration"]) == (kind, str(calibration))
        assert line["correct"] == str(int(right == answer))
    assert {line["finished"] for line in lines[:21]} == {"1"}
    assert {line["finished"] for line in lines[21:]} == {"0"}


def test_what_is_not_known_is_empty(tmp_path):
    path = made_answers(tmp_path / "answers.db", participants=1, unfinished=0)
    with closing(sqlite3.connect(path)) as db, db:
        db.execute("UPDATE answer SET response_ms = NULL")
        db.execute("UPDATE question SET angle_degrees = NULL")
    line = next(csv.DictReader(io.StringIO(to_csv(read_answers(path)))))
    assert (line["response_seconds"], line["angle_degrees"]) == ("", "")
