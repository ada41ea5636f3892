"""What a file of answers holds, for the report and for CSV; it is read as a stranger's."""

import csv
import io
import math
import re
import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from iqtt.quiz import schema
from iqtt.quiz.study import Settings
from scenegen.common.errors import FileFormatError

MOST_ROWS = 2_000_000  # answers of a file
LARGEST_MS = 2**53
NAME, KIND, SHAPE = re.compile("[0-9a-f]{16}"), re.compile("[a-z0-9 -]{1,40}"), "[0-9a-f]{12}|"


@dataclass(frozen=True)
class Answer:
    """An answer that a participant gave; the fields are the columns of the CSV file.

    Attributes:
        participant: a random name.
        finished: whether the participant answered all questions.
        calibration: whether it is practice, which does not count.
        position: place of the question in the participant's quiz, from 0.
        question: row of the split; of the calibration's file for practice.
        kind, angle_degrees, shape: as `study.Question` has them.
        right_answer, answer: places from 0.
        correct: whether they are the same.
        response_seconds: from when the images showed to the answer, by the browser; None where it
            did not tell, or told more than had passed by the server's clock.
        server_seconds: from when the page was last sent to when the answer came.
        times_shown: how often the page was sent; after a reload the times are of no use.
        order: place among all answers of the file, in the order in which they came.
    """

    participant: str
    finished: bool
    calibration: bool
    position: int
    question: int
    kind: str
    angle_degrees: float | None
    shape: str
    right_answer: int
    answer: int
    correct: bool
    response_seconds: float | None
    server_seconds: float
    times_shown: int
    order: int


@dataclass(frozen=True)
class Answers:
    """The settings of a study, and all answers in the order of participants and positions."""

    path: Path
    settings: Settings
    participants: int
    answers: tuple[Answer, ...]


def read_answers(path: str | Path) -> Answers:
    """Read a file of answers; a quiz may be writing to it.

    Raises OSError where there is no such file, FileFormatError where it is something else, damaged,
    or holds what no quiz writes, AnswersError where SQLite cannot read it now.
    """
    path = Path(path)
    schema.check_file(path)
    with schema.explained(path), _opened(path) as db:
        schema.check_content(db, path)
        db.execute("BEGIN")  # so that all that follows is of one moment
        settings = schema.settings_of(db, path)
        count, least, most = db.execute(
            "SELECT count(*), min(number), max(number) FROM participant"
        ).fetchone()
        if count and (least, most) != (0, count - 1):
            raise FileFormatError(f"{path}: participant", f"numbers to {most}", f"0 to {count - 1}")
        total = db.execute("SELECT count(*) FROM answer").fetchone()[0]
        if total > MOST_ROWS:
            raise FileFormatError(f"{path}: answer", f"{total:,} rows", f"at most {MOST_ROWS:,}")
        found = tuple(_rows(db, path, settings))
        if len(found) != total:
            expected = "one for a question of a participant"
            raise FileFormatError(f"{path}: answer", "rows that belong to no question", expected)
    return Answers(path, settings, count, found)


@contextmanager
def _opened(path: Path) -> Iterator[sqlite3.Connection]:
    """Open a file for reading, in a way that leaves nothing beside it.

    A quiz that runs has a write-ahead log. Without one nobody writes, and SQLite is told so: else
    it would make files beside this one, and fail in a folder that cannot be written to.
    """
    log = path.with_name(f"{path.name}-wal")
    fixed = "" if log.exists() and log.stat().st_size else "&immutable=1"
    address = f"{path.absolute().as_uri()}?mode=ro{fixed}"
    with closing(sqlite3.connect(address, uri=True, timeout=10)) as db:
        yield db


def _rows(db: sqlite3.Connection, path: Path, settings: Settings) -> Iterator[Answer]:
    """Yield the answers; everything in them is what a quiz writes."""
    total = settings.questions + settings.calibrations
    rows = db.execute(
        "SELECT p.number, p.name, q.position, calibration, row, kind, angle_degrees, place, shape,"
        " times_shown, shown_ms, answer, answered_ms, response_ms, sequence,"
        " (SELECT count(*) FROM answer WHERE participant = p.number)"
        " FROM participant p JOIN question q ON q.participant = p.number"
        " JOIN answer a ON a.participant = p.number AND a.position = q.position"
        " ORDER BY p.number, q.position"
    )
    before, place = -1, 0
    for row in rows:
        number, name, position, calibration, question, kind, angle, right, shape = row[:9]
        shown, shown_ms, answer, answered_ms, response_ms, sequence, answered = row[9:]
        place = place + 1 if number == before else 0
        before = number
        choices = range(settings.answers)
        good = (
            _matches(NAME, name) and _matches(KIND, kind) and _matches(re.compile(SHAPE), shape)
            and position == place and position in range(total)
            and calibration == (position < settings.calibrations)
            and _whole(question, 2**31) and right in choices and answer in choices
            and _whole(shown, 2**31) and shown > 0 and _whole(sequence, 2**62)
            and _whole(shown_ms, LARGEST_MS) and _whole(answered_ms, LARGEST_MS)
            and (angle is None or _real(angle, 180.0))
            and (response_ms is None or _real(response_ms, 1e10))
        )  # fmt: skip
        if not good:
            where = f"{path}: participant {number}, position {position}"
            raise FileFormatError(where[:200], "values that no quiz writes", "an answer")
        yield Answer(
            participant=name,
            finished=answered == total,
            calibration=bool(calibration),
            position=position,
            question=question,
            kind=kind,
            angle_degrees=angle,
            shape=shape,
            right_answer=right,
            answer=answer,
            correct=right == answer,
            response_seconds=None if response_ms is None else response_ms / 1000,
            server_seconds=max(0, answered_ms - shown_ms) / 1000,
            times_shown=shown,
            order=sequence,
        )


def _matches(pattern: re.Pattern[str], value: Any) -> bool:
    return isinstance(value, str) and pattern.fullmatch(value) is not None


def _whole(value: Any, beyond: int) -> bool:
    return type(value) is int and 0 <= value < beyond


def _real(value: Any, most: float) -> bool:
    return type(value) in (int, float) and math.isfinite(value) and 0 <= value <= most


def to_csv(found: Answers) -> str:
    """Return all answers as CSV: a head with the names of `Answer`'s fields, lines that end in LF.

    Truth is 0 or 1, and what is not known is empty.
    """
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    names = tuple(Answer.__dataclass_fields__)
    writer.writerow(names)
    for one in found.answers:
        values = (getattr(one, name) for name in names)
        writer.writerow(int(value) if isinstance(value, bool) else value for value in values)
    return out.getvalue()
