"""What happens to the file of answers: sessions begin, questions are shown, answers come in.

Each function runs in one transaction. Where it refuses, it has changed nothing. Times are those of
this machine's clock, UTC, in milliseconds since 1970; the order of answers is that of `sequence`.
"""

import secrets
import sqlite3
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from iqtt.quiz.study import Question

MOST_PARTICIPANTS = 10_000
NAME_BYTES = 8  # of a participant's random name
TOLERANCE_MS = 1000  # by which a browser's time may exceed the server's


class RefusedError(Exception):
    """A request that an honest browser does not send, or sends twice; with the HTTP status."""

    def __init__(self, status: int, text: str) -> None:
        super().__init__(text)
        self.status, self.text = status, text


@dataclass(frozen=True)
class State:
    """Where a participant is.

    Attributes:
        number: of the participant, from 0.
        position: of the question that is asked, or whose right answer is told, from 0; the number
            of all questions at the end.
        count, calibrations: numbers of all questions, and of those of the calibration.
        question: at this position; None at the end.
        told: the answer that was given, where the right one is told now; else None.
        right: at the end, how many questions that count were answered rightly.
    """

    number: int
    position: int
    count: int
    calibrations: int
    question: Question | None = None
    told: int | None = None
    right: int = 0


def now_ms() -> int:
    """Return the time of now."""
    return time.time_ns() // 1_000_000


def begin(db: sqlite3.Connection, draw: Callable[[int], Sequence[Question]], most: int) -> str:
    """Add a participant; return the participant's random name.

    Raises RefusedError where there are `most` participants already.
    """
    number = db.execute("SELECT COALESCE(MAX(number) + 1, 0) FROM participant").fetchone()[0]
    if number >= most:
        raise RefusedError(503, "The study has all the participants that it can take.")
    name = secrets.token_hex(NAME_BYTES)
    db.execute(
        "INSERT INTO participant (number, name, started_ms) VALUES (?, ?, ?)",
        (number, name, now_ms()),
    )
    db.executemany(
        "INSERT INTO question (participant, position, calibration, row, kind, angle_degrees, place,"
        " shape) VALUES (?, ?, ?, ?, ?, ?, ?, ?)",
        [
            (number, i, int(q.calibration), q.row, q.kind, q.angle_degrees, q.right, q.shape)
            for i, q in enumerate(draw(number))
        ],
    )
    return name


def state(db: sqlite3.Connection, name: str) -> State | None:
    """Return where the participant of this name is; None where there is none."""
    participant = db.execute(
        "SELECT number, feedback_seen FROM participant WHERE name = ?", (name,)
    ).fetchone()
    if participant is None:
        return None
    number, seen = participant
    rows = db.execute(
        "SELECT calibration, row, kind, angle_degrees, place, shape, answer FROM question"
        " LEFT JOIN answer USING (participant, position) WHERE participant = ? ORDER BY position",
        (number,),
    ).fetchall()
    questions = [Question(bool(row[0]), *row[1:6]) for row in rows]
    answers = [row[6] for row in rows if row[6] is not None]
    done, calibrations = len(answers), sum(question.calibration for question in questions)
    if done and seen < done and questions[done - 1].calibration:
        last = questions[done - 1]
        return State(number, done - 1, len(rows), calibrations, last, told=answers[-1])
    now = State(number, done, len(rows), calibrations)
    if done < len(rows):
        return replace(now, question=questions[done])
    pairs = zip(questions, answers, strict=True)
    return replace(now, right=sum(q.right == a for q, a in pairs if not q.calibration))


def show(db: sqlite3.Connection, name: str) -> State | None:
    """Return as `state`, and note that the question's page is sent now."""
    now = state(db, name)
    if now is not None and now.question is not None and now.told is None:
        db.execute(
            "UPDATE question SET times_shown = times_shown + 1, shown_ms = ?"
            " WHERE participant = ? AND position = ?",
            (now_ms(), now.number, now.position),
        )
    return now


def answer(
    db: sqlite3.Connection, name: str, position: int, choice: int, client_ms: float | None
) -> None:
    """Keep the answer to the question that is asked now.

    Args:
        position: of the question that the form belongs to.
        choice: place of the answer, from 0.
        client_ms: from when the images showed to the answer, as the browser says; kept only where
            the question's page was sent before that.

    Raises RefusedError without such a participant, or where another question is asked now.
    """
    now = _required(state(db, name))
    if now.question is None or now.told is not None or position != now.position:
        raise RefusedError(409, "This question has been answered, or it is not your turn yet.")
    place = (now.number, position)
    shown = db.execute(
        "SELECT shown_ms FROM question WHERE participant = ? AND position = ?", place
    ).fetchone()[0]
    if shown is None:
        raise RefusedError(409, "This question has not been shown to you yet.")
    time_ms = now_ms()
    plausible = client_ms is not None and 0 <= client_ms <= time_ms - shown + TOLERANCE_MS
    db.execute(
        "INSERT INTO answer (participant, position, answer, answered_ms, response_ms)"
        " VALUES (?, ?, ?, ?, ?)",
        (*place, choice, time_ms, client_ms if plausible else None),
    )


def go_on(db: sqlite3.Connection, name: str, position: int) -> None:
    """Note that the right answer of a calibration question was read. Raises as `answer`."""
    now = _required(state(db, name))
    if now.told is None or position != now.position:
        raise RefusedError(409, "You have gone on already.")
    db.execute(
        "UPDATE participant SET feedback_seen = ? WHERE number = ?", (position + 1, now.number)
    )


def _required(now: State | None) -> State:
    if now is None:
        raise RefusedError(403, "There is no such session. Begin on the first page.")
    return now
