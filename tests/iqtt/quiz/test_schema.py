"""Files of answers: of another split, of something else, damaged, hostile, or not to be written."""

import os
import shutil
import sqlite3
from contextlib import closing
from dataclasses import replace

import pytest
from quizzes import MADE, made_answers
from refusals import refused

from iqtt.quiz import schema
from iqtt.quiz.answers import read_answers
from iqtt.quiz.schema import AnswersError, open_answers
from scenegen.common.errors import FileFormatError, SpecError


@pytest.fixture
def path(tmp_path):
    return made_answers(tmp_path / "answers.db", participants=3)


def edited(path, *statements):
    """Edit a file as somebody who passes over the rules of its tables."""
    with closing(sqlite3.connect(path)) as db, db:
        for statement in ("PRAGMA ignore_check_constraints = ON", *statements):
            db.execute(statement)


@pytest.mark.parametrize(
    "other",
    [
        {"fingerprint": "c" * 64}, {"calibration_fingerprint": "c" * 64}, {"answers": 2},
        {"questions": 7}, {"calibrations": 0}, {"seed": 1},
    ],
)  # fmt: skip
def test_another_study_is_refused(path, other):
    before = path.read_bytes()
    with pytest.raises(SpecError) as error:
        open_answers(path, replace(MADE, **other))
    assert next(iter(other)) in str(error.value)
    assert path.read_bytes() == before


def test_what_is_durable(path):
    with closing(open_answers(path, MADE)) as db:
        assert db.execute("PRAGMA journal_mode").fetchone() == ("wal",)
        assert db.execute("PRAGMA synchronous").fetchone() == (2,)
    assert path.stat().st_mode & 0o077 == 0, "others on this machine can read the right answers"


def test_what_is_no_file_of_answers(tmp_path):
    path = tmp_path / "x.db"
    for content in (b"", b"text", schema.MAGIC, os.urandom(9000)):
        path.write_bytes(content)
        with pytest.raises(FileFormatError):
            open_answers(path, MADE)
        assert path.read_bytes() == content
    path.unlink()
    edited(path, "CREATE TABLE a (b)")
    with refused(FileFormatError, found="an SQLite file of something else"):
        read_answers(path)
    with pytest.raises(OSError, match="folder"):
        read_answers(tmp_path)
    with pytest.raises(FileNotFoundError):
        read_answers(tmp_path / "none.db")
    os.mkfifo(tmp_path / "pipe.db")
    with pytest.raises(OSError, match="regular"):
        read_answers(tmp_path / "pipe.db")
    (tmp_path / "link.db").symlink_to(path)
    with pytest.raises(OSError, match="regular"):
        open_answers(tmp_path / "link.db", MADE)


@pytest.mark.parametrize(
    "statement",
    [
        "CREATE VIEW more AS SELECT 1",
        "CREATE TRIGGER more AFTER INSERT ON answer BEGIN DELETE FROM answer; END",
        "CREATE INDEX more ON answer (hex(zeroblob(position)))",
        "ALTER TABLE answer ADD COLUMN more TEXT",
        "PRAGMA user_version = 2",
        "PRAGMA application_id = 1",
        "DROP TABLE answer",
        "DELETE FROM study",
        "INSERT INTO study SELECT * FROM study",
        "UPDATE study SET questions = -1",
        "UPDATE study SET questions = 1001",
        "UPDATE study SET questions = 5",
        "UPDATE study SET answers = 9",
        "UPDATE study SET answers = 2",
        "UPDATE study SET fingerprint = 'x' || char(27)",
        "UPDATE participant SET name = '=cmd()' WHERE number = 0",
        "UPDATE participant SET number = 7 WHERE number = 2",
        "UPDATE question SET kind = '=1+1'",
        "UPDATE question SET kind = ''",
        "UPDATE question SET angle_degrees = 1e999",
        "UPDATE question SET place = 3",
        "UPDATE question SET position = position + 100 WHERE participant = 0",
        "UPDATE question SET calibration = 1",
        "UPDATE answer SET answer = -1",
        "UPDATE answer SET response_ms = -1",
        "UPDATE answer SET response_ms = 9e999",
        "UPDATE question SET shown_ms = NULL",
        "UPDATE answer SET answered_ms = 9223372036854775807",
        "UPDATE answer SET participant = 99 WHERE participant = 0",
        "DELETE FROM answer WHERE participant = 0 AND position = 1",
    ],
)
def test_what_no_quiz_writes_is_refused(path, statement):
    edited(path, statement)
    with pytest.raises(FileFormatError):
        read_answers(path)


def test_damage_is_told(path):
    whole = path.read_bytes()
    told = 0
    for start in range(100, len(whole), 1024):
        path.write_bytes(whole[:start] + os.urandom(512) + whole[start + 512 :])
        try:
            read_answers(path)
        except (FileFormatError, AnswersError):
            told += 1
    assert told
    path.write_bytes(whole[:39] + b"\x05" + whole[40:])  # the number of unused pages
    with pytest.raises(FileFormatError) as error:
        read_answers(path)
    assert error.value.found.startswith("damage: ")
    path.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(FileFormatError):
        read_answers(path)


def test_a_file_that_takes_too_long(path, monkeypatch):
    edited(
        path,
        "WITH RECURSIVE n(i) AS (SELECT 7 UNION ALL SELECT i + 1 FROM n WHERE i < 3000) INSERT INTO"
        " participant SELECT i, printf('%016x', i), 0, 0 FROM n",
    )
    assert len(read_answers(path).answers) == 24
    monkeypatch.setattr(schema, "MOST_STEPS", 1)
    with refused(FileFormatError, found="too much"):
        read_answers(path)


def test_a_file_that_another_process_holds(path, monkeypatch):
    connect = sqlite3.connect
    monkeypatch.setattr(sqlite3, "connect", lambda *a, **k: connect(*a, **{**k, "timeout": 0.05}))
    with closing(connect(path)) as other:
        other.execute("BEGIN EXCLUSIVE")
        with pytest.raises(AnswersError) as error:
            open_answers(path, MADE)
    assert "locked" in error.value.found


def test_a_file_that_cannot_be_written(path, monkeypatch):
    """As on a disk that is mounted for reading, which root cannot write to either."""
    connect = sqlite3.connect

    def for_reading(file, **how):
        return connect(f"{file.absolute().as_uri()}?mode=ro", uri=True, **how)

    monkeypatch.setattr(sqlite3, "connect", for_reading)
    with refused(AnswersError, found="readonly"):
        open_answers(path, MADE)


def test_it_is_read_while_a_quiz_writes_and_from_a_copy(path, tmp_path):
    with closing(open_answers(path, MADE)) as db:
        db.execute("UPDATE participant SET feedback_seen = feedback_seen")
        assert len(read_answers(path).answers) == 3 * 7 + 3
    shutil.copy(path, tmp_path / "copy.db")
    assert read_answers(tmp_path / "copy.db").answers == read_answers(path).answers
