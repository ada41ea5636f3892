"""What happens to the file of answers: sessions begin, questions are shown, answers come in.

Each function runs in one transaction. Where it refuses, it has changed nothing. Times are those of
this machine's clock, UTC, in milliseconds since 1970; the order of answers is that of `sequence`.
"""

import hashlib
import hmac
import secrets
import sqlite3
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from iqtt.quiz.study import Question

MOST_PARTICIPANTS = 10_000
TOKEN_BYTES = 32
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
        results: at the end, each question that counts, and whether the answer was right.
    """

    number: int
    position: int
    count: int
    calibrations: int
    question: Question | None
    told: int | None
    results: Sequence[tuple[Question, bool]] = ()

    @property
    def finished(self) -> bool:
        """Whether all is answered."""
        return self.question is None


def now_ms() -> int:
    """Return the time of now."""
    return time.time_ns() // 1_000_000


def begin(db: sqlite3.Connection, draw: Callable[[int], Sequence[Question]], most: int) -> str:
    """Add a participant; return the session's token, which nobody can guess.

    Raises RefusedError where there are `most` participants already.
    """
    number = db.execute("SELECT COALESCE(MAX(number) + 1, 0) FROM participant").fetchone()[0]
    if number >= most:
        raise RefusedError(503, "The study has all the participants that it can take.")
    token = secrets.token_urlsafe(TOKEN_BYTES)
    db.execute(
        "INSERT INTO participant (number, name, token_sha256, started_ms) VALUES (?, ?, ?, ?)",
        (number, secrets.token_hex(8), _digest(token), now_ms()),
    )
    db.executemany(
        "INSERT INTO question (participant, position, calibration, row, kind, angle_degrees, place,"
        " shape) VALUES (?, ?, ?, ?, ?, ?, ?, ?)",
        [
            (number, i, int(q.calibration), q.row, q.kind, q.angle_degrees, q.right, q.shape)
            for i, q in enumerate(draw(number))
        ],
    )
    return token


def state(db: sqlite3.Connection, token: str) -> State | None:
    """Return where the participant of a token is; None where there is none."""
    found = db.execute(
        "SELECT number, feedback_seen FROM participant WHERE token_sha256 = ?", (_digest(token),)
    ).fetchone()
    if found is None:
        return None
    number, seen = found
    rows = db.execute(
        "SELECT calibration, row, kind, angle_degrees, place, shape, answer FROM question"
        " LEFT JOIN answer USING (participant, position) WHERE participant = ? ORDER BY position",
        (number,),
    ).fetchall()
    questions = [Question(bool(row[0]), *row[1:6]) for row in rows]
    answers = [row[6] for row in rows if row[6] is not None]
    done, calibrations = len(answers), sum(question.calibration for question in questions)
    found_state = State(number, done, len(questions), calibrations, None, None)
    if done and seen < done and questions[done - 1].calibration:
        return replace(
            found_state, position=done - 1, question=questions[done - 1], told=answers[-1]
        )
    if done < len(questions):
        return replace(found_state, question=questions[done])
    results = [(q, q.right == a) for q, a in zip(questions, answers, strict=True)]
    return replace(found_state, results=[pair for pair in results if not pair[0].calibration])


def show(db: sqlite3.Connection, token: str) -> State | None:
    """Return as `state`, and note that the question's page is sent now."""
    found = state(db, token)
    if found is not None and found.question is not None and found.told is None:
        db.execute(
            "UPDATE question SET times_shown = times_shown + 1, shown_ms = ?"
            " WHERE participant = ? AND position = ?",
            (now_ms(), found.number, found.position),
        )
    return found


def answer(
    db: sqlite3.Connection, token: str, form: str, choice: int, client_ms: float | None, key: bytes
) -> None:
    """Keep the answer to the question that is asked now.

    Args:
        form: the name of the form that was sent, as `form_name` gives it.
        choice: place of the answer, from 0.
        client_ms: from when the images showed to the answer, as the browser says; kept only where
            the question's page was sent before that.

    Raises RefusedError without such a session, or where the form belongs to another question.
    """
    found = _required(state(db, token))
    expected = form_name(key, found.number, found.position)
    if found.question is None or found.told is not None or not _same(form, expected):
        raise RefusedError(409, "This question has been answered, or it is not your turn yet.")
    place = (found.number, found.position)
    shown = db.execute(
        "SELECT shown_ms FROM question WHERE participant = ? AND position = ?", place
    ).fetchone()[0]
    if shown is None:
        raise RefusedError(409, "This question has not been shown to you yet.")
    now = now_ms()
    plausible = client_ms is not None and 0 <= client_ms <= now - shown + TOLERANCE_MS
    db.execute(
        "INSERT INTO answer (participant, position, answer, answered_ms, response_ms)"
        " VALUES (?, ?, ?, ?, ?)",
        (*place, choice, now, client_ms if plausible else None),
    )


def go_on(db: sqlite3.Connection, token: str, form: str, key: bytes) -> None:
    """Note that the right answer of a calibration question was read. Raises as `answer`."""
    found = _required(state(db, token))
    if found.told is None or not _same(form, form_name(key, found.number, found.position)):
        raise RefusedError(409, "You have gone on already.")
    db.execute(
        "UPDATE participant SET feedback_seen = ? WHERE number = ?",
        (found.position + 1, found.number),
    )


def form_name(key: bytes, number: int, position: int) -> str:
    """Return what the form of one question of one participant says, which nobody else can."""
    return _keyed(key, f"form {number} {position}")


def image_names(key: bytes, number: int, position: int, count: int) -> list[str]:
    """Return the names of the images of one question of one participant; they tell nothing."""
    return [_keyed(key, f"image {number} {position} {k}") for k in range(count)]


def _keyed(key: bytes, text: str) -> str:
    return hmac.new(key, text.encode(), hashlib.sha256).hexdigest()[:32]


def _same(given: str, expected: str) -> bool:
    return hmac.compare_digest(given.encode(), expected.encode())


def _required(found: State | None) -> State:
    if found is None:
        raise RefusedError(403, "There is no such session. Begin on the first page.")
    return found


def _digest(token: str) -> bytes:
    return hashlib.sha256(token.encode()).digest()
