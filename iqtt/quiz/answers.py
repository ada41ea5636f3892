"""What a file of answers holds, for the report and for CSV; it is read as a stranger's."""

import csv
import io
import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import astuple, dataclass, fields
from pathlib import Path

from iqtt.quiz import schema
from iqtt.quiz.study import Settings
from scenegen.common.errors import FileFormatError

MOST_ROWS = 2_000_000  # answers of a file
ROWS = """
    SELECT p.name, done = study.questions + study.calibrations, q.calibration, q.position, q.row,
        q.kind, q.angle_degrees, q.shape, q.place, a.answer, q.place = a.answer,
        a.response_ms / 1000, max(0, a.answered_ms - q.shown_ms) / 1000.0, q.times_shown, a.sequence
    FROM study, participant p
    JOIN (SELECT participant, count(*) AS done FROM answer GROUP BY participant) d
        ON d.participant = p.number
    JOIN question q ON q.participant = p.number
    JOIN answer a ON a.participant = p.number AND a.position = q.position
    ORDER BY p.number, q.position"""


@dataclass(frozen=True)
class Answer:
    """An answer that a participant gave; the fields are the columns of the CSV file, and of `ROWS`.

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
    with schema.explained(path), _copied(path) as db:
        schema.check_content(db, path)
        total = db.execute("SELECT count(*) FROM answer").fetchone()[0]
        if total > MOST_ROWS:
            raise FileFormatError(f"{path}: answer", f"{total:,} rows", f"at most {MOST_ROWS:,}")
        participants = db.execute("SELECT count(*) FROM participant").fetchone()[0]
        answers = tuple(_answer(row) for row in db.execute(ROWS))
        return Answers(path, schema.settings_of(db), participants, answers)


@contextmanager
def _copied(path: Path) -> Iterator[sqlite3.Connection]:
    """Copy a file, as it is at one moment, into memory; nothing is left beside it.

    A quiz that runs has a write-ahead log. Without one nobody writes, and SQLite is told so: else
    it would make files beside this one, and fail in a folder that cannot be written to. SQLite
    checks the rules of tables in a copy, but not in a file that is opened for reading.
    """
    log = path.with_name(f"{path.name}-wal")
    fixed = "" if log.exists() and log.stat().st_size else "&immutable=1"
    address = f"{path.absolute().as_uri()}?mode=ro{fixed}"
    with (
        closing(sqlite3.connect(address, uri=True, timeout=10)) as file,
        closing(sqlite3.connect(":memory:")) as copy,
    ):
        file.execute("BEGIN")
        file.execute("SELECT count(*) FROM sqlite_schema").fetchone()  # `backup` waits for ever
        file.backup(copy)
        yield copy


def _answer(row: tuple[object, ...]) -> Answer:
    """Return a row of `ROWS` as an answer; SQLite has 0 and 1 for truth."""
    columns = zip(fields(Answer), row, strict=True)
    values = {f.name: bool(value) if f.type is bool else value for f, value in columns}
    return Answer(**values)  # type: ignore[arg-type]


def to_csv(answers_file: Answers) -> str:
    """Return all answers as CSV: a head with the names of `Answer`'s fields, lines that end in LF.

    Truth is 0 or 1, and what is not known is empty.
    """
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(field.name for field in fields(Answer))
    for answer in answers_file.answers:
        writer.writerow(int(v) if isinstance(v, bool) else v for v in astuple(answer))
    return out.getvalue()
